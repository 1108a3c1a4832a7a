#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace dtact::web {

/// The page's files, all of them in memory.
class Page {
 public:
  struct File {
    std::string_view bytes;
    std::string_view type;  ///< "text/html; charset=utf-8"
    std::string tag;        ///< An entity tag of HTTP, with its quotation marks.
  };

  /// Those built into the program; none where it was built without.
  Page();
  /// Those of a folder. Throws std::runtime_error naming a file that cannot be read, one whose kind
  /// is not known, or the index.html that is missing.
  explicit Page(const std::filesystem::path& folder);
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  /// The file at a path like "/app.js"; "/" is index.html. Null: no file.
  [[nodiscard]] const File* find(std::string_view path) const;
  [[nodiscard]] bool empty() const noexcept { return files_.empty(); }

 private:
  void add(const std::string& name, std::string_view bytes);

  std::map<std::string, std::string> read_;         ///< Contents of the folder's files.
  std::map<std::string, File, std::less<>> files_;  ///< By path.
};

}  // namespace dtact::web
