#include "daemon/net/server.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <utility>

#include "daemon/net/commands.hpp"
#include "daemon/net/hub.hpp"
#include "daemon/serve/listeners.hpp"

namespace dtact::net {

struct Server::Impl {
  Impl(boost::asio::io_context& io, NetConfig settings, pipeline::Port& port,
       CalibrationStore& store)
      : listeners(io, std::move(settings)),
        worker(1),
        hub(std::make_shared<Hub>(io, listeners.config(), port)),
        commands(std::make_shared<Commands>(io, worker, listeners.config(), *hub, port, store)) {
    hub->set_endpoints(listeners.endpoints());
  }

  Listeners listeners;
  boost::asio::thread_pool worker;
  std::shared_ptr<Hub> hub;
  std::shared_ptr<Commands> commands;
};

Server::Server(boost::asio::io_context& io, NetConfig config, pipeline::Port& port,
               CalibrationStore& store)
    : impl_(std::make_unique<Impl>(io, std::move(config), port, store)) {
  impl_->hub->start(*impl_->commands);
  impl_->listeners.open(impl_->hub,
                        [&hub = *impl_->hub](const auto& session) { hub.admit(session); });
}

Server::~Server() { stop(); }

Overview Server::overview() const { return impl_->commands->overview(); }

std::vector<std::string> Server::addresses() const { return impl_->listeners.addresses(); }

void Server::reload(const NetConfig& fresh) {
  impl_->listeners.reload(fresh);
  impl_->hub->set_endpoints(impl_->listeners.endpoints());
  impl_->hub->end_revoked();
}

std::uint16_t Server::port() const { return impl_->listeners.port(); }

void Server::stop() {
  impl_->listeners.close();
  impl_->hub->stop();
}

}  // namespace dtact::net
