// A token file: an accepted one grants the rights that its own lines name and nothing else; a
// refused one gets a message that is a sentence.
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
    std::string said;
    std::string hash;
    words >> said >> hash;
    if (said.empty() || said.front() == '#') continue;
    for (const auto& [word, rights] : {std::pair("view", net::Rights::view),
                                       {"control", net::Rights::control},
                                       {"calibrate", net::Rights::calibrate}}) {
      require(tokens.holds({rights, {}, hash}) == (said == word),
              "a line grants the rights that it names");
    }
    require(!tokens.find(hash), "a hash grants nothing to a client that shows it");
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
