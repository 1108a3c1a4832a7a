#include "proto/encodings/predict_zstd.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "proto/encodings/map_size.hpp"

static_assert(std::endian::native == std::endian::little, "two nibbles are joined as one word");

namespace dtact::wire {
namespace {

constexpr std::uint16_t kEscape = 15;       ///< A nibble that says: look at the second part.
constexpr std::uint16_t kLongEscape = 255;  ///< A byte there that says: two more follow.

// Loops without branches, of which compilers make vectors.

std::uint16_t zigzag(int residual) noexcept {
  const auto bits = static_cast<std::uint16_t>(residual);
  return static_cast<std::uint16_t>((bits << 1U) ^ -(bits >> 15U));
}

void predict_row(const std::int16_t* row, const std::int16_t* above, std::size_t width,
                 std::uint16_t* residuals) noexcept {
  residuals[0] = zigzag(row[0] - above[0]);
  for (std::size_t x = 1; x < width; ++x)
    residuals[x] = zigzag((row[x] - row[x - 1]) - (above[x] - above[x - 1]));
}

void cap_row(const std::uint16_t* residuals, std::size_t width, std::uint8_t* capped) noexcept {
  for (std::size_t x = 0; x < width; ++x)
    capped[x] = static_cast<std::uint8_t>(residuals[x] < kEscape ? residuals[x] : kEscape);
}

/// `capped`: an even number of them.
void join_nibbles(const std::uint8_t* capped, std::size_t bytes, std::uint8_t* joined) noexcept {
  for (std::size_t i = 0; i < bytes; ++i) {
    std::uint16_t two = 0;
    std::memcpy(&two, capped + 2 * i, sizeof two);
    joined[i] = static_cast<std::uint8_t>(two | (two >> 4U));
  }
}

void part_nibbles(const std::uint8_t* joined, std::size_t pixels,
                  std::int16_t* residuals) noexcept {
  for (std::size_t i = 0; i < pixels / 2; ++i) {
    residuals[2 * i] = joined[i] & 15;
    residuals[2 * i + 1] = static_cast<std::int16_t>(joined[i] >> 4U);
  }
  if (pixels % 2 != 0) residuals[pixels - 1] = joined[pixels / 2] & 15;
}

/// Where in eight nibbles, each in a byte of its own, those of 15 are: the highest bit of the byte.
constexpr std::uint64_t find_escapes(std::uint64_t nibbles) noexcept {
  return (nibbles + 0x7171717171717171U) & 0x8080808080808080U;
}

/// load() may read this number of bytes beyond its data.
constexpr std::size_t kPadding = 7;

std::uint64_t load(const std::uint8_t* eight) noexcept {
  std::uint64_t word = 0;
  std::memcpy(&word, eight, sizeof word);
  return word;
}

/// `capped`: the residuals' nibbles, and kPadding more.
void append_escapes(std::span<const std::uint16_t> residuals, const std::uint8_t* capped,
                    std::vector<std::uint8_t>& out) {
  for (std::size_t x = 0; x < residuals.size(); x += 8) {
    std::uint64_t escapes = find_escapes(load(capped + x));
    if (const std::size_t left = residuals.size() - x; left < 8) {
      escapes &= (std::uint64_t{1} << 8 * left) - 1;
    }
    for (; escapes != 0; escapes &= escapes - 1) {
      const std::uint16_t residual =
          residuals[x + static_cast<std::size_t>(std::countr_zero(escapes)) / 8];
      if (residual - kEscape < kLongEscape) {
        out.push_back(static_cast<std::uint8_t>(residual - kEscape));
      } else {
        out.insert(out.end(), {kLongEscape, static_cast<std::uint8_t>(residual & 255U),
                               static_cast<std::uint8_t>(residual >> 8U)});
      }
    }
  }
}

/// Reads the second part.
class Escapes {
 public:
  explicit Escapes(std::span<const std::uint8_t> bytes) noexcept : bytes_(bytes) {}
  bool take(std::int16_t& residual) noexcept {
    if (bytes_.empty()) return false;
    unsigned value = bytes_[0] + unsigned{kEscape};
    std::size_t size = 1;
    if (bytes_[0] == kLongEscape) {
      size = 3;
      if (bytes_.size() < size) return false;
      value = bytes_[1] | (unsigned{bytes_[2]} << 8U);
      if (value < kEscape + kLongEscape) return false;
    }
    residual = static_cast<std::int16_t>(value);
    bytes_ = bytes_.subspan(size);
    return true;
  }
  [[nodiscard]] bool at_end() const noexcept { return bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// Puts the second part in the place of the nibbles of 15. `joined`: the first part, and kPadding
/// bytes more.
bool take_escapes(const std::uint8_t* joined, std::span<const std::uint8_t> second,
                  std::span<std::int16_t> residuals) noexcept {
  constexpr std::uint64_t kLow = 0x0F0F0F0F0F0F0F0FU;
  Escapes escapes(second);
  for (std::size_t at = 0; at < residuals.size(); at += 16) {
    const std::uint64_t word = load(joined + at / 2);
    if ((find_escapes(word & kLow) | find_escapes((word >> 4U) & kLow)) == 0) continue;
    for (auto& residual : residuals.subspan(at, std::min<std::size_t>(16, residuals.size() - at))) {
      if (residual == kEscape && !escapes.take(residual)) return false;
    }
  }
  return escapes.at_end();
}

/// Running sums along the row, on top of the row above. In three loops, of which only the one in
/// the middle has to go a pixel at a time.
void add_up(std::int16_t* row, const std::int16_t* above, std::size_t width) noexcept {
  for (std::size_t x = 0; x < width; ++x) {
    const auto zigzag = static_cast<std::uint16_t>(row[x]);
    row[x] = static_cast<std::int16_t>((zigzag >> 1U) ^ -(zigzag & 1U));
  }
  unsigned sum = 0;
  for (std::size_t x = 0; x < width; ++x) {
    sum += static_cast<std::uint16_t>(row[x]);
    row[x] = static_cast<std::int16_t>(sum);
  }
  for (std::size_t x = 0; x < width; ++x)
    row[x] =
        static_cast<std::int16_t>(static_cast<unsigned>(row[x]) + static_cast<unsigned>(above[x]));
}

}  // namespace

void PredictZstdEncoder::encode(std::span<const std::int16_t> depth, std::size_t width,
                                std::string& out) {
  require_whole_rows(depth.size(), width);
  const std::size_t pixels = depth.size();
  const std::size_t bytes = (pixels + 1) / 2;
  nothing_.resize(width);
  residuals_.resize(width);
  capped_.resize(2 * bytes + kPadding);
  content_.resize(bytes);
  const std::int16_t* above = nothing_.data();
  for (std::size_t at = 0; at < pixels; at += width) {
    predict_row(depth.data() + at, above, width, residuals_.data());
    cap_row(residuals_.data(), width, capped_.data() + at);
    append_escapes(residuals_, capped_.data() + at, content_);
    above = depth.data() + at;
  }
  if (pixels % 2 != 0) capped_[pixels] = 0;
  join_nibbles(capped_.data(), bytes, content_.data());
  zstd_.compress(std::as_bytes(std::span(content_)), out);
}

bool decode_predict_zstd(std::string_view bytes, std::size_t width, std::size_t height,
                         std::vector<std::int16_t>& depth) {
  if (!plausible_size(width, height)) return false;
  const std::size_t pixels = width * height;
  const std::size_t first = (pixels + 1) / 2;
  const auto size = zstd_content_size(bytes);
  if (!size || *size < first || *size > first + 3 * pixels) return false;
  std::vector<std::uint8_t> padded(*size + kPadding);
  const auto content = std::span(padded).first(*size);
  if (!zstd_decompress(bytes, std::as_writable_bytes(content))) return false;
  if (pixels % 2 != 0 && content[first - 1] > 15) return false;
  depth.resize(pixels);
  part_nibbles(content.data(), pixels, depth.data());
  if (!take_escapes(content.data(), content.subspan(first), depth)) return false;
  const std::vector<std::int16_t> nothing(width);
  const std::int16_t* above = nothing.data();
  for (std::size_t at = 0; at < pixels; at += width) {
    add_up(depth.data() + at, above, width);
    above = depth.data() + at;
  }
  return true;
}

}  // namespace dtact::wire
