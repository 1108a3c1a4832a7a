#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/manual/command.hpp"

// The manual pages and zsh's completions. Their sources are the texts of `--help`, the keys of the
// configuration and the commented config/dtactd.toml.
namespace dtact::manual {

/// A page by its name: {"dtactd.toml", 5}.
using PageName = std::pair<std::string, int>;

/// Parts of a program's page that its help does not have.
struct PageNotes {
  int section = 1;
  std::string volume;
  std::vector<std::pair<std::string, std::string>> files;  ///< Path, what is in it.
  std::vector<PageName> see_also;
};

[[nodiscard]] std::string program_page(const Command& program, const PageNotes& notes);

/// The page dtactd.toml(5) from the text of config/dtactd.toml. Throws std::runtime_error for a key
/// that only one of the daemon and the file has.
[[nodiscard]] std::string config_page(const std::string& toml);

/// A file for zsh's fpath that completes `program`.
[[nodiscard]] std::string zsh_completion(const Command& program);

/// Descriptions of the programs as built.
[[nodiscard]] Command dtactd();
[[nodiscard]] Command dtactctl();
[[nodiscard]] Command dtact_calibrate();
[[nodiscard]] Command dtact_perceive();
[[nodiscard]] Command dtact_web();
[[nodiscard]] Command dtact_dds();

/// A generated file, by its path in the tree.
struct File {
  std::filesystem::path path;
  std::string text;
};

/// All generated files, from the programs as built and the files of the tree `root`.
[[nodiscard]] std::vector<File> all_files(const std::filesystem::path& root);

}  // namespace dtact::manual
