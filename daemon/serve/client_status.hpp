#pragma once

namespace dtact::v1 {
class ClientStatus;
class Endpoint;
}  // namespace dtact::v1

namespace dtact::net {

class Session;
struct EndpointInfo;

// Of GetStatus' answer. Each fills a message that is empty.

void fill(const EndpointInfo& endpoint, v1::Endpoint& out);
/// Of a client that has been greeted.
void fill(const Session& session, v1::ClientStatus& out);

}  // namespace dtact::net
