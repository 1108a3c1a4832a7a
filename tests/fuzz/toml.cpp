// TOML of any kind. What passes the bounds is parsed, and the parser makes no more of it than the
// bounds counted.
#include <toml++/toml.h>

#include <algorithm>
#include <cstddef>
#include <stdexcept>

#include "hal/files/key_reader.hpp"
#include "hal/files/toml_bounds.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

struct Tree {
  std::size_t nodes = 0;
  std::size_t depth = 0;
};

void count(const toml::node& node, std::size_t depth, Tree& tree) {
  ++tree.nodes;
  tree.depth = std::max(tree.depth, depth);
  if (const toml::table* table = node.as_table()) {
    for (const auto& [key, value] : *table) count(value, depth + 1, tree);
  }
  if (const toml::array* array = node.as_array()) {
    for (const toml::node& value : *array) count(value, depth + 1, tree);
  }
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    const tomlfile::Counts counts = tomlfile::check_bounds(text, "seed");
    const toml::table document = tomlfile::parse(text, "seed");
    fuzz::Tree tree;
    fuzz::count(document, 0, tree);
    fuzz::require(tree.nodes <= counts.keys + counts.values + 1, "every node was counted");
    // A header's parts, and in each level of a value those of a key.
    constexpr std::size_t kDeepest = tomlfile::kMaxDepth * (tomlfile::kMaxDepth + 3);
    fuzz::require(tree.depth <= kDeepest, "no tree is deeper than the bounds allow");
  } catch (const std::runtime_error& e) {
    fuzz::require(*e.what() != 0, "an error says something");
  }
  return 0;
}
