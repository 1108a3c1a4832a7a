#pragma once

#include <functional>
#include <memory>
#include <string>

#include "daemon/announce/service.hpp"

namespace boost::asio {
class io_context;
}

namespace dtact::announce {

/// Keeps a service announced through avahi-daemon: as soon as one runs on this machine, again when
/// it starts anew, under the next free name when another machine has this one. Lives without: it
/// starts none, waits for none and says once what is missing. Works on the thread that runs `io`
/// and never waits there.
class Announcer {
 public:
  using Ask = std::function<Service()>;
  using Log = std::function<void(const std::string&)>;

  /// `ask` is asked now and then: a service that changed is announced anew.
  Announcer(boost::asio::io_context& io, Ask ask, Log log);
  ~Announcer();
  Announcer(const Announcer&) = delete;
  Announcer& operator=(const Announcer&) = delete;

  /// Takes the service back.
  void stop();

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace dtact::announce
