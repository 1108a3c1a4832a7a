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
  requester.refuse(v1::ERROR_BUSY, kBusy);
  return false;
}

Requester::Requester(const std::shared_ptr<Session>& session, const v1::ClientMessage& message,
                     const Log& log)
    : session_(session),
      id_(message.id()),
      change_(describe_change(*session, message)),
      log_(&log) {}

void Requester::reply(const std::function<void(v1::Reply&)>& fill, bool first,
                      const std::string& result) const {
  log_change(*log_, change_, result);
  const auto session = session_.lock();
  if (session == nullptr) return;
  v1::ServerMessage message;
  message.mutable_reply()->set_id(id_);
  fill(*message.mutable_reply());
  session->send(message, first);
}

void Requester::refuse(int error_code, const std::string& sentence) const {
  log_change(*log_, change_, sentence);
  if (const auto session = session_.lock()) session->reply_error(id_, error_code, sentence);
}

void Requester::reply(const pipeline::CommandDone& done,
                      const std::function<void(v1::Reply&)>& fill) const {
  if (done.outcome != pipeline::Outcome::done) return refuse(code_of(done.outcome), done.message);
  reply(fill);
}

}  // namespace dtact::net
