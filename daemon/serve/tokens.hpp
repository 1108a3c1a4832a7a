#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/serve/rights.hpp"

namespace dtact::net {

/// Who may come in, by the token in Hello. Keeps digests, not the tokens.
class Tokens {
 public:
  /// Shorter ones can be guessed.
  static constexpr std::size_t kMinBytes = 16;

  using Digest = std::array<unsigned char, 32>;
  struct Grant {
    Rights rights = Rights::view;
    std::string name;              ///< What the file calls it, for the log; may be empty.
    std::optional<Digest> digest;  ///< Nothing: the client needed no token.
  };

  /// A line for each token: the rights ("view", "control", "calibrate"), the token, and a name or
  /// not; printable ASCII, separated by spaces. Empty lines and lines that begin with '#' are
  /// skipped. `file` names the text in errors. Throws std::runtime_error with file, line and fix,
  /// never with a token; a text without any token is an error, too.
  Tokens(std::string_view text, const std::string& file);

  /// Takes equally long whatever is asked, right or wrong.
  [[nodiscard]] std::optional<Grant> find(std::string_view token) const;
  /// Whether the token of an earlier grant still has the same rights.
  [[nodiscard]] bool holds(const Grant& grant) const;

 private:
  static Digest digest_of(std::string_view token);
  [[nodiscard]] const Grant* grant_of(const Digest& digest) const;

  std::vector<Grant> grants_;
};

}  // namespace dtact::net
