#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <memory>
#include <thread>

#include "clients/perceive/server.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {

/// dtact-perceive's server on a thread of the test.
class Perceive {
 public:
  explicit Perceive(const Sensor& sensor) {
    client::Options daemon;
    daemon.port = sensor.daemon->port();
    net::NetConfig config;
    config.port = 0;
    config.features = wire::kPerceiveFeatures;
    server_ = std::make_shared<perceive::Server>(io_, config, daemon, nullptr);
    server_->start();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Perceive() {
    boost::asio::post(io_, [this] { server_->stop(); });
    thread_.join();
  }
  Perceive(const Perceive&) = delete;
  Perceive& operator=(const Perceive&) = delete;

  [[nodiscard]] client::Client connect() const {
    client::Options options;
    options.port = server_->port();
    return client::Client(options);
  }

 private:
  boost::asio::io_context io_;
  std::shared_ptr<perceive::Server> server_;
  std::thread thread_;
};

}  // namespace dtact::e2e
