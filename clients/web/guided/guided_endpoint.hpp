#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/web/guided/relay.hpp"
#include "clients/web/request.hpp"
#include "clients/web/source.hpp"
#include "daemon/serve/admission.hpp"
#include "daemon/serve/net_config.hpp"

namespace dtact::cli {
class GuidedStart;
}

namespace dtact::web::guided {

/// Serves /sensors/NAME/calibrate: guided calibrations and the teaching of objects, one session of
/// each sensor at a time, and a few that need no sensor. On the thread that runs the gateway's
/// `io`.
class GuidedEndpoint {
 public:
  /// `work`: below it each calibration saves what it takes; `taught`: folder of taught objects.
  /// What is passed by reference must outlive this.
  GuidedEndpoint(std::vector<std::shared_ptr<Source>> sensors, std::filesystem::path work,
                 std::filesystem::path taught, const net::NetConfig& config,
                 net::Admission& admission);

  void add(std::shared_ptr<Source> sensor) { sensors_.push_back(std::move(sensor)); }
  void stop();
  /// Ends the sessions whose token was revoked or has other rights now.
  void end_revoked();
  [[nodiscard]] bool knows(std::string_view path) const { return find(path) != nullptr; }
  /// Opens a path for which knows() is true; `token`: the page's.
  [[nodiscard]] Upgrade upgrade(std::string_view path, std::string token);

 private:
  [[nodiscard]] Source* find(std::string_view path) const;
  void admit(const Source& sensor, std::shared_ptr<WebSocket> socket, const net::Peer& peer,
             const std::string& token);
  /// dtact-calibrate as the page's first message wants it. Throws std::exception with a sentence
  /// for the page.
  [[nodiscard]] std::shared_ptr<Child> begin(const Source& sensor, const cli::GuidedStart& start,
                                             Relay& relay, Child::Handlers handlers);

  std::vector<std::shared_ptr<Source>> sensors_;
  std::filesystem::path work_;
  std::filesystem::path taught_;
  const net::NetConfig& config_;
  net::Admission& admission_;
  struct Open {
    std::weak_ptr<Relay> relay;
    net::Tokens::Grant grant;
  };
  std::vector<Open> relays_;
  std::map<std::string, std::weak_ptr<Child>> children_;  ///< By the sensor's name.
  std::vector<std::weak_ptr<Child>> without_sensor_;
};

}  // namespace dtact::web::guided
