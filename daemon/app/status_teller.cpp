#include "daemon/app/status_teller.hpp"

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
    const auto condition = static_cast<pipeline::Health>(i);
    if (!status.health.has(condition)) continue;
    health += (health.empty() ? "" : ", ") + net::health_name(condition);
  }
  return fmt::format("{}, {:.0f} fps, {}; {}{}{}", net::state_name(status.state), status.fps,
                     health.empty() ? "healthy" : health, note, note.empty() ? "" : "; ",
                     listening);
}

StatusTeller::StatusTeller(boost::asio::io_context& io, std::function<pipeline::Status()> status,
                           std::string listening, pipeline::HealthSet told)
    : timer_(io), status_(std::move(status)), listening_(std::move(listening)), conditions_(told) {
  wait();
}

void StatusTeller::stop() {
  // The timer may have expired already: then its handler still comes, without an error.
  stopped_ = true;
  timer_.cancel();
}

void StatusTeller::wait() {
  timer_.expires_after(std::chrono::seconds(1));
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || stopped_) return;
    const pipeline::Status status = status_();
    const std::string text = status_text(status, note_, listening_);
    if (told_ != text && notify_status(text)) told_ = text;
    for (const auto& line : conditions_.step(status, std::chrono::steady_clock::now())) {
      log_line(line.warning ? spdlog::level::warn : spdlog::level::info, line.text,
               {{"DTACT_CONDITION", line.condition}});
    }
    wait();
  });
}

}  // namespace dtact::app
