#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/serve/rights.hpp"

namespace dtact::net {

/// Who may come in, by the token in Hello. Neither the file nor this class has the tokens, only
/// their hashes (wire::token_hash()).
class Tokens {
 public:
  struct Grant {
    Rights rights = Rights::view;
    std::string name;  ///< What the file calls it, for the log; may be empty.
    std::string hash;  ///< Empty: the client needed no token.
  };

  /// A line for each token: the rights ("view", "control", "calibrate"), the hash, and a name or
  /// not; printable ASCII, separated by spaces. Empty lines and lines that begin with '#' are
  /// skipped. `file` names the text in errors. Throws std::runtime_error with file, line and fix,
  /// never with a token; a text without any token is an error, too.
  Tokens(std::string_view text, const std::string& file);

  /// Takes equally long whatever is asked, right or wrong.
  [[nodiscard]] std::optional<Grant> find(std::string_view token) const;
  /// Whether the token of an earlier grant still has the same rights.
  [[nodiscard]] bool holds(const Grant& grant) const;

 private:
  [[nodiscard]] const Grant* grant_of(std::string_view hash) const;

  std::vector<Grant> grants_;
};

}  // namespace dtact::net
