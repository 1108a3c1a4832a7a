#include "daemon/app/status_reporter.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <utility>

#include "daemon/app/journal.hpp"
#include "daemon/app/service.hpp"
#include "daemon/net/advice.hpp"

namespace dtact::app {

std::string status_text(const pipeline::Status& status, const std::string& note,
                        const std::string& listening) {
  std::string health;
  for (int i = 0; i < pipeline::kHealthCount; ++i) {
    const auto flag = static_cast<pipeline::Health>(i);
    if (!status.health.has(flag)) continue;
    health += (health.empty() ? "" : ", ") + net::health_name(flag);
  }
  return fmt::format("{}, {:.0f} fps, {}; {}{}{}", net::state_name(status.state), status.fps,
                     health.empty() ? "healthy" : health, note, note.empty() ? "" : "; ",
                     listening);
}

StatusReporter::StatusReporter(boost::asio::io_context& io,
                               std::function<pipeline::Status()> status, std::string listening,
                               pipeline::HealthSet reported)
    : timer_(io),
      status_(std::move(status)),
      listening_(std::move(listening)),
      health_flags_(reported) {
  wait();
}

void StatusReporter::stop() {
  // The timer may have expired already: then its handler still comes, without an error.
  stopped_ = true;
  timer_.cancel();
}

void StatusReporter::wait() {
  timer_.expires_after(std::chrono::seconds(1));
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || stopped_) return;
    const pipeline::Status status = status_();
    const std::string text = status_text(status, note_, listening_);
    if (reported_ != text && notify_status(text)) reported_ = text;
    for (const auto& line : health_flags_.step(status, std::chrono::steady_clock::now())) {
      log_line(line.warning ? spdlog::level::warn : spdlog::level::info, line.text,
               {{"DTACT_HEALTH", line.flag}});
    }
    wait();
  });
}

}  // namespace dtact::app
