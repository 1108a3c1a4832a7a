// Writes the manual pages and zsh's completions into the tree: ./dev man.
#include <exception>
#include <iostream>

#include "hal/base/atomic_file.hpp"
#include "tests/unit/manual/pages.hpp"

int main() {
  try {
    const std::filesystem::path root = DTACT_SOURCE_DIR;
    for (const auto& [path, text] : dtact::manual::all_files(root)) {
      dtact::base::write_file_atomically(root / path, text);
    }
    return 0;
  } catch (const std::exception& e) {
    std::cerr << "make_manual: " << e.what() << '\n';
    return 1;
  }
}
