#include "clients/web/page.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <utility>

#include "clients/web/built_in.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::web {
namespace {

namespace fs = std::filesystem;

/// Largest file of a page, bytes.
constexpr std::size_t kMaxFile = std::size_t{64} << 20U;

constexpr std::array<std::pair<std::string_view, std::string_view>, 12> kTypes{{
    {".css", "text/css; charset=utf-8"},
    {".html", "text/html; charset=utf-8"},
    {".ico", "image/x-icon"},
    {".jpg", "image/jpeg"},
    {".js", "text/javascript; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".png", "image/png"},
    {".svg", "image/svg+xml"},
    {".txt", "text/plain; charset=utf-8"},
    {".wasm", "application/wasm"},
    {".woff2", "font/woff2"},
}};

std::string_view type_of(const std::string& name) {
  const std::string extension = fs::path(name).extension().string();
  for (const auto& [known, type] : kTypes) {
    if (extension == known) return type;
  }
  throw std::runtime_error(
      fmt::format("{}: there is no content type for a file of this name: leave it out of the "
                  "page, or add its kind to clients/web/page.cpp",
                  name));
}

/// FNV-1a: distinguishes versions of a file, nothing more.
std::string tag_of(std::string_view bytes) {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const char byte : bytes) hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3;
  return fmt::format("\"{:016x}\"", hash);
}

}  // namespace

Page::Page() {
  for (const BuiltIn& file : built_in_page()) add(std::string(file.name), file.bytes);
}

Page::Page(const fs::path& folder) {
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    const std::string name = entry.path().lexically_relative(folder).generic_string();
    const auto [read, fresh] = read_.emplace(name, base::read_file(entry.path(), kMaxFile));
    add(name, read->second);
  }
  if (find("/") == nullptr) {
    throw std::runtime_error(
        fmt::format("{}: there is no index.html: name the folder that the page was built into",
                    folder.string()));
  }
}

void Page::add(const std::string& name, std::string_view bytes) {
  files_["/" + name] = {bytes, type_of(name), tag_of(bytes)};
}

const Page::File* Page::find(std::string_view path) const {
  const auto found = files_.find(path == "/" ? "/index.html" : path);
  return found == files_.end() ? nullptr : &found->second;
}

}  // namespace dtact::web
