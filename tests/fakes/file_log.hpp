#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dtact::fakes {

/// What this thread asks of the file system below a folder while the object lives, in order, as a
/// power cut would find it: "write a/b", "sync a/b", "rename a/b to c". Paths are relative to the
/// folder, which is "."; the six letters by which a temporary file is told from others are
/// "XXXXXX". The calls themselves are done as ever. One at a time.
class FileLog {
 public:
  explicit FileLog(const std::filesystem::path& folder);
  FileLog(const FileLog&) = delete;
  FileLog& operator=(const FileLog&) = delete;
  ~FileLog();

  [[nodiscard]] const std::vector<std::string>& calls() const noexcept { return calls_; }

  /// For the wrapped calls alone.
  void add(const std::string& what, const std::string& path, const std::string& to = {});

 private:
  std::filesystem::path folder_;
  std::vector<std::string> calls_;
};

}  // namespace dtact::fakes
