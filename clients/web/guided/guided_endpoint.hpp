#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cpp/options.hpp"
#include "clients/web/guided/relay.hpp"
#include "clients/web/request.hpp"
#include "clients/web/source.hpp"
#include "daemon/serve/admission.hpp"
#include "daemon/serve/net_config.hpp"

namespace dtact::web::guided {

/// A sensor that may be calibrated.
struct Calibrated {
  std::shared_ptr<Source> source;
  client::Options options;  ///< How its daemon is reached.
};

/// Serves /sensors/NAME/calibrate: one session of each sensor at a time. On the thread that
/// runs the gateway's `io`.
class GuidedEndpoint {
 public:
  /// `work`: below it each session saves what it takes. What is passed by reference must outlive
  /// this.
  GuidedEndpoint(std::vector<Calibrated> sensors, std::filesystem::path work,
                 const net::NetConfig& config, net::Admission& admission);

  void stop();
  /// Ends the sessions whose token was revoked or has other rights now.
  void end_revoked();
  [[nodiscard]] bool knows(std::string_view path) const { return find(path) != nullptr; }
  /// Opens a path for which knows() is true; `token`: the page's.
  [[nodiscard]] Upgrade upgrade(std::string_view path, std::string token);

 private:
  [[nodiscard]] const Calibrated* find(std::string_view path) const;
  void admit(const Calibrated& sensor, std::shared_ptr<WebSocket> socket, const net::Peer& peer,
             const std::string& token);
  /// dtact-calibrate as the page's first message wants it. Throws std::exception with a sentence
  /// for the page.
  [[nodiscard]] std::shared_ptr<Child> begin(const Calibrated& sensor, const std::string& start,
                                             Relay& relay, Child::Handlers handlers);

  std::vector<Calibrated> sensors_;
  std::filesystem::path work_;
  const net::NetConfig& config_;
  net::Admission& admission_;
  struct Open {
    std::weak_ptr<Relay> relay;
    net::Tokens::Grant grant;
  };
  std::vector<Open> relays_;
  std::map<std::string, std::weak_ptr<Child>> children_;  ///< By the sensor's name.
};

}  // namespace dtact::web::guided
