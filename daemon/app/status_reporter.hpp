#pragma once

#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <string>

#include "daemon/app/health_log.hpp"

namespace boost::asio {
class io_context;
}

namespace dtact::app {

/// What `systemctl status` shows: "serving, 60 fps, healthy; listening on 127.0.0.1:7377". `note`,
/// unless empty, stands before where it listens.
[[nodiscard]] std::string status_text(const pipeline::Status& status, const std::string& note,
                                      const std::string& listening);

/// Reports changes of the sensor's status to the service manager and the log, once a second.
/// Runs on the thread that runs `io`.
class StatusReporter {
 public:
  /// `reported`: health flags that have already been logged.
  StatusReporter(boost::asio::io_context& io, std::function<pipeline::Status()> status,
                 std::string listening, pipeline::HealthSet reported);
  /// The text at this moment.
  [[nodiscard]] std::string text() const { return status_text(status_(), note_, listening_); }
  /// What else there is to say from now on.
  void set_note(std::string note) { note_ = std::move(note); }
  /// Then `io` has no work of it left.
  void stop();

 private:
  void wait();

  boost::asio::steady_timer timer_;
  bool stopped_ = false;
  std::function<pipeline::Status()> status_;
  std::string listening_;
  std::string note_;
  std::string reported_;
  HealthLog health_flags_;
};

}  // namespace dtact::app
