#include "daemon/serve/client_status.hpp"

#include "daemon/serve/security.hpp"
#include "daemon/serve/session.hpp"
#include "daemon/serve/tls.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {

void fill(const EndpointInfo& endpoint, v1::Endpoint& out) {
  out.set_address(endpoint.address);
  out.set_tls(endpoint.tls);
  out.set_token(endpoint.token);
  out.set_insecure(endpoint.insecure);
  out.set_fingerprint(endpoint.fingerprint);
  if (endpoint.certificate_expires) {
    using namespace std::chrono;
    out.set_certificate_days(
        days_until(*endpoint.certificate_expires, floor<seconds>(system_clock::now())));
  }
}

void fill(const Session& session, v1::ClientStatus& out) {
  out.set_address(session.peer().address);
  out.set_program(session.program());
  out.set_sent(session.outbox().sent());
  out.set_dropped(session.outbox().dropped());
  out.set_rights(static_cast<v1::Rights>(session.rights()));
  out.set_endpoint(session.peer().endpoint);
  out.set_sent_bytes(session.outbox().sent_bytes());
  out.set_waiting_bytes(session.outbox().waiting_bytes());
}

}  // namespace dtact::net
