#include "daemon/net/server.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "daemon/net/commands.hpp"
#include "daemon/net/hub.hpp"
#include "daemon/net/listener.hpp"

namespace dtact::net {

struct Server::Impl {
  Impl(boost::asio::io_context& io, NetConfig settings, pipeline::Port& port,
       CalibrationStore& store)
      : config(std::move(settings)),
        worker(1),
        hub(std::make_shared<Hub>(io, config, port)),
        commands(std::make_shared<Commands>(io, worker, config, *hub, port, store)),
        listener(
            std::make_shared<Listener>(io, config, [this](std::unique_ptr<Transport> transport) {
              hub->admit(std::make_shared<Session>(std::move(transport), config, hub));
            })) {}

  NetConfig config;
  boost::asio::thread_pool worker;
  std::shared_ptr<Hub> hub;
  std::shared_ptr<Commands> commands;
  std::shared_ptr<Listener> listener;
};

Server::Server(boost::asio::io_context& io, NetConfig config, pipeline::Port& port,
               CalibrationStore& store)
    : impl_(std::make_unique<Impl>(io, std::move(config), port, store)) {
  auto& commands = *impl_->commands;
  impl_->hub->start(
      {[&commands](const std::shared_ptr<Session>& session, const v1::ClientMessage& message) {
         commands.on_request(session, message);
       },
       [&commands](const pipeline::CommandDone& done) { commands.on_done(done); },
       [&commands](const hal::Light& light) { commands.on_light(light); }});
  impl_->listener->start();
}

Server::~Server() { stop(); }

std::uint16_t Server::port() const { return impl_->listener->port(); }

void Server::stop() {
  impl_->listener->stop();
  impl_->hub->stop();
}

}  // namespace dtact::net
