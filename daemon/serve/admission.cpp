#include "daemon/serve/admission.hpp"

#include <fmt/format.h>

#include "daemon/serve/private_file.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {

std::optional<Tokens> read_tokens(const NetConfig& config) {
  if (config.token_file.empty()) return std::nullopt;
  return Tokens(read_private_file(config.token_file, "the token file"), config.token_file.string());
}

Admission::Admission(const NetConfig& config) : config_(config), tokens_(read_tokens(config)) {}

Admission::Verdict Admission::enter(const Peer& peer, const std::string& token) {
  Verdict verdict;
  if (!tokens_.has_value() || peer.trusted) {
    verdict.rights = Rights::control;
  } else if (auto grant = tokens_->find(token)) {
    verdict.rights = grant->rights;
    verdict.token_name = std::move(grant->name);
  } else {
    verdict.error_code = v1::ERROR_DENIED;
    verdict.sentence = token.empty() ? "this daemon asks for a token: give the client one of those "
                                       "in the daemon's token file"
                                     : "this daemon does not know the token: take one of those in "
                                       "the daemon's token file";
    return verdict;
  }
  std::size_t& of_host = hosts_[peer.host];
  if (clients_ >= config_.max_clients) {
    verdict.sentence = fmt::format(
        "{} clients are connected and no more are allowed: end one or raise the daemon's "
        "max_clients",
        clients_);
  } else if (of_host >= config_.max_clients_per_address) {
    verdict.sentence = fmt::format(
        "{} clients are connected from {} and no more are allowed: end one or raise the daemon's "
        "max_clients_per_address",
        of_host, peer.host);
  } else {
    ++clients_;
    ++of_host;
    return verdict;
  }
  if (of_host == 0) hosts_.erase(peer.host);
  verdict.rights.reset();
  verdict.error_code = v1::ERROR_BUSY;
  return verdict;
}

void Admission::leave(const Peer& peer) {
  --clients_;
  const auto host = hosts_.find(peer.host);
  if (--host->second == 0) hosts_.erase(host);
}

bool Admission::hold(std::size_t before, std::size_t now) noexcept {
  incoming_ = incoming_ - before + now;
  return now <= before || incoming_ <= kMaxIncoming;
}

}  // namespace dtact::net
