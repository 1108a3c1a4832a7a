#include "daemon/serve/admission.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "daemon/serve/private_file.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {

std::optional<Tokens> read_tokens(const NetConfig& config) {
  if (config.token_file.empty()) return std::nullopt;
  return Tokens(read_private_file(config.token_file, "the token file"), config.token_file.string());
}

Admission::Admission(const NetConfig& config) : config_(config), tokens_(read_tokens(config)) {}

Admission::Verdict Admission::judge(const Peer& peer, const std::string& token) {
  Verdict verdict;
  if (peer.trusted) {
    verdict.grant = {.rights = Rights::calibrate, .name = {}, .hash = {}};
  } else if (!tokens_.has_value()) {
    verdict.grant = {.rights = config_.anonymous_rights, .name = {}, .hash = {}};
  } else {
    verdict.grant = tokens_->find(token);
  }
  if (!verdict.grant) {
    verdict.error_code = v1::ERROR_DENIED;
    verdict.sentence = token.empty() ? "this daemon asks for a token: give the client one of those "
                                       "in the daemon's token file"
                                     : "this daemon does not know the token: take one of those in "
                                       "the daemon's token file";
    verdict.delay = token.empty() ? kDenial : delay_after_wrong(peer.host);
    return verdict;
  }
  const auto found = hosts_.find(peer.host);
  const std::size_t of_host = found == hosts_.end() ? 0 : found->second;
  if (clients_ >= config_.max_clients + (peer.trusted ? kReserved : 0)) {
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
    return verdict;
  }
  verdict.grant.reset();
  verdict.error_code = v1::ERROR_BUSY;
  return verdict;
}

Admission::Verdict Admission::enter(const Peer& peer, const std::string& token) {
  Verdict verdict = judge(peer, token);
  if (verdict.grant) {
    ++clients_;
    ++hosts_[peer.host];
  }
  return verdict;
}

std::chrono::milliseconds Admission::delay_after_wrong(const std::string& host) {
  const auto now = Clock::now();
  std::erase_if(wrong_, [&](const auto& one) { return now - one.second.last > kForgetWrong; });
  if (wrong_.size() >= kMaxWrongHosts && !wrong_.contains(host)) {
    wrong_.erase(
        std::ranges::min_element(wrong_, {}, [](const auto& one) { return one.second.last; }));
  }
  Wrong& wrong = wrong_[host];
  wrong.last = now;
  return std::min(kMaxDenial, kDenial * (1U << std::min(wrong.count++, 16U)));
}

bool Admission::take_handshake(const Peer& peer) {
  if (handshakes_.size() >= kMaxHandshakeHosts && !handshakes_.contains(peer.host)) {
    handshakes_.clear();
  }
  const auto bucket = handshakes_.try_emplace(peer.host, kHandshakesPerS, kHandshakesPerS).first;
  if (bucket->second.take(1)) return true;
  config_.log({LogLevel::warning,
               fmt::format("client {}: more than {} TLS handshakes a second came from {}",
                           peer.address, kHandshakesPerS, peer.host),
               peer.address, LogSubject::unauthenticated});
  return false;
}

void Admission::leave(const Peer& peer) {
  --clients_;
  const auto host = hosts_.find(peer.host);
  if (--host->second == 0) hosts_.erase(host);
}

void Admission::hold(const void* client, const std::string& host, std::size_t bytes,
                     std::function<void()> disconnect) {
  if (const auto found = held_.find(client); found != held_.end()) {
    held_bytes_ -= found->second.bytes;
    held_.erase(found);
  }
  if (bytes == 0) return;
  held_[client] = {host, bytes, std::move(disconnect)};
  held_bytes_ += bytes;
  while (held_bytes_ > kMaxHeld) {
    const auto worst = worst_beside(client);
    // One alone has at most Outbox::kMaxBytes, two messages to it and one from it.
    if (worst == held_.end()) return;
    const auto end = std::move(worst->second.disconnect);
    held_bytes_ -= worst->second.bytes;
    held_.erase(worst);
    end();
  }
}

Admission::HeldMap::iterator Admission::worst_beside(const void* asking) {
  std::map<std::string_view, std::size_t> hosts;
  for (const auto& [client, one] : held_) hosts[one.host] += one.bytes;
  auto worst = held_.end();
  const auto weight = [&](const Held& one) { return std::pair(hosts[one.host], one.bytes); };
  for (auto it = held_.begin(); it != held_.end(); ++it) {
    if (it->first == asking) continue;
    if (worst == held_.end() || weight(it->second) > weight(worst->second)) worst = it;
  }
  return worst;
}

}  // namespace dtact::net
