// A token file: an accepted one grants the rights that its own lines name and nothing else; a
// refused one gets a message that reveals no token.
#include "daemon/serve/tokens.hpp"

#include <sstream>
#include <stdexcept>

#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

void use(const net::Tokens& tokens, const std::string& text) {
  bool granted = false;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string rights;
    std::string token;
    words >> rights >> token;
    if (rights.empty() || rights.front() == '#') continue;
    const auto grant = tokens.find(token);
    require(grant.has_value(), "every line's token is known");
    const auto said = rights == "view"      ? net::Rights::view
                      : rights == "control" ? net::Rights::control
                                            : net::Rights::calibrate;
    require(grant->rights == said, "a token grants what its line says");
    const std::string other = token + "x";
    require(text.find(other) != std::string::npos || !tokens.find(other),
            "what stands nowhere in the file grants nothing");
    granted = true;
  }
  require(granted, "a file that grants nothing is refused");
  require(!tokens.find(""), "no token grants nothing");
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    fuzz::use(net::Tokens(text, "file"), text);
  } catch (const std::runtime_error& e) {
    fuzz::require_sentence(e.what());
  }
  return 0;
}
