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
/// Fills in the status of an authenticated client.
void fill(const Session& session, v1::ClientStatus& out);

}  // namespace dtact::net
