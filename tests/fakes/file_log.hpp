#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dtact::fakes {

/// This thread's changes to the file system below a folder while the object lives, in order, as a
/// power cut would find them: "write a/b", "sync a/b", "rename a/b to c". Paths are relative to the
/// folder, which is "."; the six random letters of a temporary file's name are
/// "XXXXXX". The calls themselves are made as usual. One object at a time.
class FileLog {
 public:
  explicit FileLog(const std::filesystem::path& folder);
  FileLog(const FileLog&) = delete;
  FileLog& operator=(const FileLog&) = delete;
  ~FileLog();

  [[nodiscard]] const std::vector<std::string>& calls() const noexcept { return calls_; }

  /// Called by the wrapped functions only.
  void add(const std::string& what, const std::string& path, const std::string& to = {});

 private:
  std::filesystem::path folder_;
  std::vector<std::string> calls_;
};

}  // namespace dtact::fakes
