#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "clients/web/foxglove/foxglove_client.hpp"
#include "clients/web/foxglove/sensor_topics.hpp"
#include "clients/web/request.hpp"
#include "daemon/serve/admission.hpp"
#include "daemon/serve/net_config.hpp"

namespace dtact::web::foxglove {

/// Where Foxglove's clients come in: /foxglove for all sensors, /sensors/NAME/foxglove for one.
class FoxgloveEndpoint {
 public:
  /// `find`: others will be added. What is passed by reference must outlive it.
  FoxgloveEndpoint(const std::vector<std::shared_ptr<Source>>& sources, bool find,
                   const net::NetConfig& config, net::Admission& admission);

  void start();
  /// Another sensor, after start(), also for the clients of /foxglove.
  void add(std::shared_ptr<Source> source);
  void stop();
  /// Ends the clients whose token was revoked or has other rights now.
  void end_revoked();
  /// Whether a path is one of this door's.
  [[nodiscard]] bool knows(std::string_view path) const {
    return path == kAll || !mounts(path).empty();
  }
  [[nodiscard]] Upgrade upgrade(const Request& request);

 private:
  struct Client {
    std::weak_ptr<FoxgloveClient> client;
    bool all;  ///< It has all sensors.
  };
  static constexpr std::string_view kAll = "/foxglove";

  [[nodiscard]] std::vector<Mount> mounts(std::string_view path) const;
  void admit(std::shared_ptr<WebSocket> socket, const net::Peer& peer, const std::string& token,
             std::string_view path);

  const bool find_;
  const net::NetConfig& config_;
  net::Admission& admission_;
  std::vector<std::shared_ptr<SensorTopics>> sensors_;
  std::vector<Client> clients_;
};

}  // namespace dtact::web::foxglove
