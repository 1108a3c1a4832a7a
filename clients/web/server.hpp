#pragma once

#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "clients/common/avahi.hpp"
#include "clients/common/daemon_option.hpp"
#include "clients/web/foxglove/foxglove_endpoint.hpp"
#include "clients/web/guided/guided_endpoint.hpp"
#include "clients/web/http_connection.hpp"
#include "clients/web/page.hpp"
#include "clients/web/request.hpp"
#include "clients/web/sensor.hpp"
#include "daemon/serve/admission.hpp"
#include "daemon/serve/listener.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/tls.hpp"

namespace dtact::web {

struct Settings {
  net::NetConfig net;
  std::vector<cli::NamedDaemon> daemons;
  bool find = false;  ///< Others come by Server::add().
  /// By which browsers may name this machine, besides its addresses.
  std::vector<std::string> host_names;
  /// Origins that may open Foxglove's WebSocket besides our own and those of programs on the
  /// desktop.
  std::vector<std::string> foxglove_origins;
  /// Below it guided calibrations save what they take.
  std::filesystem::path work_folder;
  std::filesystem::path taught;  ///< Folder of the objects that pages teach.
};

/// dtact-web as a whole: the page, and a WebSocket for each daemon. All but the connections to the
/// daemons is on the thread that runs `io`.
class Server : public Site, public std::enable_shared_from_this<Server> {
 public:
  /// Listens from here on. `page` must outlive it. Throws std::runtime_error naming the setting,
  /// file, address or port and the fix.
  Server(boost::asio::io_context& io, Settings settings, const Page& page);

  void start();
  /// A daemon that announced itself, after start(); of one whose name is known the address
  /// is used from the next connection on. One that cannot be connected to for lack of threads or
  /// descriptors is logged and left out.
  void add(const cli::Finder::Found& found);
  void stop();
  /// Reads certificate, key and tokens again, and ends who has a token no more. Throws as the
  /// constructor, and changes nothing then.
  void reload();
  /// "http://127.0.0.1:7380/"
  [[nodiscard]] std::string address() const;
  /// The TCP port it listens on.
  [[nodiscard]] std::uint16_t port() const { return listener_->port(); }

  [[nodiscard]] Answer answer(const Request& request, const net::Peer& peer) override;
  [[nodiscard]] Upgrade upgrade(const Request& request, const net::Peer& peer) override;

 private:
  [[nodiscard]] bool is_for_us(const Request& request) const;
  [[nodiscard]] std::string sensors() const;
  [[nodiscard]] Answer fleet(const Request& request, const net::Peer& peer);
  [[nodiscard]] std::shared_ptr<Sensor> find(std::string_view path) const;
  [[nodiscard]] std::vector<std::shared_ptr<Source>> sources() const;

  boost::asio::io_context& io_;
  net::NetConfig config_;
  std::vector<std::string> host_names_;
  std::vector<std::string> foxglove_origins_;
  const Page& page_;
  std::unique_ptr<net::Tls> tls_;
  net::CertificateWatch certificate_watch_;
  net::Admission admission_;
  HttpLimits limits_;
  std::vector<std::shared_ptr<Sensor>> sensors_;
  std::unique_ptr<foxglove::FoxgloveEndpoint> foxglove_;
  std::unique_ptr<guided::GuidedEndpoint> guided_;
  std::shared_ptr<net::Listener> listener_;
};

}  // namespace dtact::web
