#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "hal/base/unique_fd.hpp"
#include "hal/files/mcap_bytes.hpp"
#include "hal/files/mcap_format.hpp"

namespace dtact::mcap {

/// The records of an MCAP file by their place in it, in bytes. What is not as announced throws
/// Error with the file's name and the place; nothing is held that the file does not hold.
class RecordFile {
 public:
  /// Throws std::system_error when the file cannot be read.
  explicit RecordFile(const std::filesystem::path& path);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Bytes, when it was opened.
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  /// Those bytes. Throws std::system_error, too.
  [[nodiscard]] std::string load(std::uint64_t offset, std::uint64_t length) const;
  /// The fields of the record at `offset`, of this kind.
  [[nodiscard]] std::string load_record(std::uint64_t offset, Op expected) const;
  /// The records of the chunk at `offset`, decompressed and checked.
  [[nodiscard]] std::string load_chunk(std::uint64_t offset) const;

  /// Returns a cursor over `bytes`, which begin at `offset`, for reading their fields.
  [[nodiscard]] Cursor cursor(std::string_view bytes, std::uint64_t offset) const {
    return {bytes, name_, offset};
  }
  [[noreturn]] void fail(std::uint64_t offset, std::string_view what) const;

 private:
  std::string name_;
  base::UniqueFd fd_;
  std::uint64_t size_ = 0;
};

}  // namespace dtact::mcap
