#pragma once

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "hal/base/unique_fd.hpp"

// Common parts of the fuzz targets. A target is a function of bytes (libFuzzer's interface) that
// ends the program when the tested code breaks a promise; exceptions that its header does not name
// do the same.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace dtact::fuzz {

/// `promise`: the sentence that should have held.
inline void require(bool holds, std::string_view promise) {
  if (holds) return;
  std::fputs(fmt::format("broken: {}\n", promise).c_str(), stderr);
  std::abort();
}

/// An error message that travels over the wire, where text is UTF-8 (RFC 3629).
inline void require_sentence(std::string_view text) {
  require(!text.empty(), "an error says something");
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = [&](std::size_t at) {
      return at < text.size() ? static_cast<unsigned char>(text[at]) : 0U;
    };
    const unsigned first = byte(i);
    const std::size_t length = first < 0x80 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
    bool valid = first < 0x80 || (first >= 0xC2 && first < 0xF5);
    for (std::size_t k = 1; k < length; ++k) valid = valid && (byte(i + k) & 0xC0U) == 0x80;
    require(valid, "an error message is UTF-8: " + std::string(text));
    i += length;
  }
}

/// Splits `text` at each `separator` into at most `most` parts; the last one holds the rest.
inline std::vector<std::string> split(std::string_view text, std::string_view separator,
                                      std::size_t most) {
  std::vector<std::string> parts;
  while (parts.size() + 1 < most) {
    const std::size_t at = text.find(separator);
    if (at == std::string_view::npos) break;
    parts.emplace_back(text.substr(0, at));
    text.remove_prefix(at + separator.size());
  }
  parts.emplace_back(text);
  return parts;
}

/// A file in memory with a path, for code that reads files.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view content) : fd_(::memfd_create("fuzz", MFD_CLOEXEC)) {
    if (!fd_ || ::write(fd_.get(), content.data(), content.size()) !=
                    static_cast<ssize_t>(content.size())) {
      throw std::system_error(errno, std::generic_category(), "memfd");
    }
  }
  [[nodiscard]] std::filesystem::path path() const {
    return fmt::format("/proc/self/fd/{}", fd_.get());
  }

 private:
  base::UniqueFd fd_;
};

}  // namespace dtact::fuzz
