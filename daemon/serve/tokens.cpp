#include "daemon/serve/tokens.hpp"

#include <fmt/format.h>
#include <openssl/crypto.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "proto/fingerprint.hpp"

namespace dtact::net {
namespace {

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  constexpr const char* kSpace = " \t\r";
  for (;;) {
    const std::size_t begin = line.find_first_not_of(kSpace);
    if (begin == std::string_view::npos) return words;
    line.remove_prefix(begin);
    const std::size_t size = std::min(line.find_first_of(kSpace), line.size());
    words.push_back(line.substr(0, size));
    line.remove_prefix(size);
  }
}

/// The least first.
constexpr std::array<std::pair<std::string_view, Rights>, 3> kRights = {
    {{"view", Rights::view}, {"control", Rights::control}, {"calibrate", Rights::calibrate}}};

std::optional<Rights> rights_of(std::string_view word) {
  const auto found = std::ranges::find(kRights, word, [](const auto& one) { return one.first; });
  if (found == kRights.end()) return std::nullopt;
  return found->second;
}

bool is_printable(std::string_view word) {
  return std::all_of(word.begin(), word.end(), [](char c) { return c > ' ' && c < 0x7f; });
}

constexpr std::string_view kHash = "sha256:";

/// What is wrong with a line of these words; empty: nothing.
std::string wrong_with(const std::vector<std::string_view>& words) {
  if (words.size() < 2 || words.size() > 3 || !rights_of(words[0])) {
    return "a line is \"view HASH NAME\", \"control HASH NAME\" or \"calibrate HASH NAME\", the "
           "name may be left out: dtactctl token --new view -o FILE prints one";
  }
  if (!std::all_of(words.begin(), words.end(), is_printable)) {
    return "only printable ASCII characters are allowed";
  }
  if (!words[1].starts_with(kHash)) {
    return fmt::format(
        "a token itself must not be kept here, only its hash: with the token in FILE, "
        "dtactctl token --hash {} --token-file FILE prints the line",
        words[0]);
  }
  const std::string_view digits = words[1].substr(kHash.size());
  if (digits.size() != 64 ||
      digits.find_first_not_of("0123456789abcdef") != std::string_view::npos) {
    return fmt::format("\"{}\" is not followed by 64 hexadecimal digits in lower case", kHash);
  }
  return {};
}

}  // namespace

Tokens::Tokens(std::string_view text, const std::string& file) {
  for (unsigned line = 1; !text.empty(); ++line) {
    const std::size_t size = std::min(text.find('\n'), text.size());
    const auto words = words_of(text.substr(0, size));
    text.remove_prefix(std::min(size + 1, text.size()));
    if (words.empty() || words[0].front() == '#') continue;
    std::string wrong = wrong_with(words);
    Grant grant;
    if (wrong.empty()) {
      grant = {*rights_of(words[0]), std::string(words.size() == 3 ? words[2] : std::string_view()),
               std::string(words[1])};
      if (grant_of(grant.hash) != nullptr) wrong = "the same token stands on a line above";
    }
    if (!wrong.empty()) throw std::runtime_error(fmt::format("{}:{}: {}", file, line, wrong));
    grants_.push_back(std::move(grant));
  }
  if (grants_.empty()) {
    throw std::runtime_error(fmt::format(
        "{}: holds no token's hash, so that nobody could connect: dtactctl token --new control "
        "-o FILE prints one",
        file));
  }
}

std::optional<Tokens::Grant> Tokens::find(std::string_view token) const {
  const Grant* grant = grant_of(wire::token_hash(token));
  if (grant == nullptr) return std::nullopt;
  return *grant;
}

bool Tokens::holds(const Grant& grant) const {
  const Grant* now = grant.hash.empty() ? nullptr : grant_of(grant.hash);
  return now != nullptr && now->rights == grant.rights;
}

const Tokens::Grant* Tokens::grant_of(std::string_view hash) const {
  const Grant* found = nullptr;
  // All have one length. Compares all of them, so that the time does not reveal which one matched.
  for (const Grant& grant : grants_) {
    if (::CRYPTO_memcmp(grant.hash.data(), hash.data(), hash.size()) == 0) found = &grant;
  }
  return found;
}

}  // namespace dtact::net
