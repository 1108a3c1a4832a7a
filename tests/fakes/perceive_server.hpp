#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "clients/cpp/client.hpp"
#include "clients/perceive/server.hpp"

namespace dtact::fakes {

/// dtact-perceive's server on a thread of the test.
class PerceiveServer {
 public:
  explicit PerceiveServer(const client::Options& daemon) {
    net::NetConfig config;
    config.port = 0;
    config.features = wire::kPerceiveFeatures;
    config.log = [this](const net::LogLine& line) {
      const std::scoped_lock lock(mutex_);
      log_ += line.text + '\n';
    };
    server_ = std::make_shared<perceive::Server>(io_, config, daemon);
    server_->start();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~PerceiveServer() {
    boost::asio::post(io_, [this] { server_->stop(); });
    thread_.join();
  }
  PerceiveServer(const PerceiveServer&) = delete;
  PerceiveServer& operator=(const PerceiveServer&) = delete;

  [[nodiscard]] client::Client connect() const {
    client::Options options;
    options.port = server_->port();
    return client::Client(options);
  }
  [[nodiscard]] std::uint16_t port() const { return server_->port(); }
  [[nodiscard]] std::string log() const {
    const std::scoped_lock lock(mutex_);
    return log_;
  }

 private:
  mutable std::mutex mutex_;
  std::string log_;
  boost::asio::io_context io_;
  std::shared_ptr<perceive::Server> server_;
  std::thread thread_;
};

}  // namespace dtact::fakes
