#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

#include "hal/base/unique_fd.hpp"

namespace dtact::mcap {

/// Where a Writer's bytes go.
class Sink {
 public:
  virtual ~Sink() = default;
  /// All of `bytes` or nothing. Throws std::system_error.
  virtual void append(std::string_view bytes) = 0;
  /// Returns once what was appended outlives a power cut. Throws std::system_error.
  virtual void sync() = 0;
};

/// A new file. What could not be written whole is cut off again, so that it always ends where a
/// record does.
class FileSink final : public Sink {
 public:
  /// `replace`: a file of that name is emptied; else it is an error. Throws std::system_error with
  /// the file's name: `called`, where it will be renamed to that.
  FileSink(const std::filesystem::path& path, bool replace,
           const std::filesystem::path& called = {});

  void append(std::string_view bytes) override;
  void sync() override;

 private:
  std::filesystem::path path_;  // for sentences
  base::UniqueFd fd_;
  std::uint64_t size_ = 0;
};

}  // namespace dtact::mcap
