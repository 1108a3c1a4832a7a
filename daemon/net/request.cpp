#include "daemon/net/request.hpp"

#include "daemon/net/messages.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

v1::ErrorCode code_of(pipeline::Outcome outcome) {
  switch (outcome) {
    case pipeline::Outcome::done:
      return v1::ERROR_NONE;
    case pipeline::Outcome::refused_contact:
    case pipeline::Outcome::refused_unsteady:
      return v1::ERROR_CONTACT;
    case pipeline::Outcome::device_error:
    case pipeline::Outcome::camera_away:
    case pipeline::Outcome::ring_away:
      return v1::ERROR_DEVICE;
    case pipeline::Outcome::refused_dark:
      return v1::ERROR_INVALID;
    case pipeline::Outcome::uncalibrated:
      return v1::ERROR_UNCALIBRATED;
    case pipeline::Outcome::no_reference:
      return v1::ERROR_BUSY;
  }
  return v1::ERROR_INVALID;
}

}  // namespace

bool submit(pipeline::Port& port, const Requester& requester,
            decltype(pipeline::Command::what) what,
            std::function<void(const pipeline::CommandDone&)> then) {
  if (port.submit({std::move(what), std::move(then)})) return true;
  requester.first->reply_error(requester.second, v1::ERROR_BUSY, kBusy);
  return false;
}

void reply(const WeakWho& requester, const pipeline::CommandDone& done,
           const std::function<void(v1::Reply&)>& fill) {
  const auto session = requester.first.lock();
  if (session == nullptr) return;
  if (done.outcome != pipeline::Outcome::done) {
    return session->reply_error(requester.second, code_of(done.outcome), done.message);
  }
  auto message = reply_to(requester.second);
  fill(*message.mutable_reply());
  session->send(message);
}

}  // namespace dtact::net
