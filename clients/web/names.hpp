#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace dtact::web {

/// "[::1]:7380" → "::1", "gripper:7380" → "gripper".
[[nodiscard]] std::string_view without_port(std::string_view host);

/// Whether a request that names `host` (the Host field, with or without a port) is meant for this
/// gateway: an IP address, localhost, or one of `names`, whatever their ports. What else leads here
/// does so by a name server that an unauthenticated client's page has arranged (DNS rebinding): to
/// a browser the gateway would then be of that page's own origin.
[[nodiscard]] bool is_own_host(std::string_view host, const std::vector<std::string>& names);

/// Whether a page of `origin` may open a WebSocket here: one that came from here by the same name,
/// or one of `others`, word for word.
[[nodiscard]] bool is_own_origin(std::string_view origin, std::string_view host, bool tls,
                                 const std::vector<std::string>& others);

/// This machine's name, alone and under .local, as far as it has one.
[[nodiscard]] std::vector<std::string> machine_names();

}  // namespace dtact::web
