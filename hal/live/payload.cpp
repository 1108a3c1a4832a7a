#include "hal/live/payload.hpp"

#include "hal/luma/luma.hpp"

namespace dtact::hal::live {
namespace {

luma::Layout layout_of(Encoding encoding) {
  switch (encoding) {
    case Encoding::grey10:
      return luma::Layout::grey10;
    case Encoding::grey16:
      return luma::Layout::grey16;
    case Encoding::yuyv:
      return luma::Layout::yuyv;
    case Encoding::nv12:
      return luma::Layout::nv12;
    default:
      return luma::Layout::grey;
  }
}

/// FF D8 at the beginning, FF D9 at the end, followed by nothing but padding: drivers round
/// payloads up with zeros (or with FF, as JPEG itself does).
bool has_markers(std::span<const std::uint8_t> payload) noexcept {
  if (payload.size() < 4 || payload[0] != 0xFF || payload[1] != 0xD8) return false;
  std::size_t end = payload.size();
  while (end > 4 && (payload[end - 1] == 0x00 || payload[end - 1] == 0xFF)) --end;
  return payload[end - 2] == 0xFF && payload[end - 1] == 0xD9;
}

}  // namespace

PayloadDecoder::PayloadDecoder(const Format& format, int scale)
    : format_(format),
      jpeg_(format.encoding == Encoding::jpeg
                ? std::make_unique<mjpeg::GreyDecoder>(format.width, format.height, scale)
                : nullptr) {}

void PayloadDecoder::will_read(const Area& area) noexcept {
  if (jpeg_) jpeg_->set_crop(area);
}

PayloadStatus PayloadDecoder::inspect(const FilledBuffer& filled) const noexcept {
  if (filled.flagged) return PayloadStatus::flagged;
  if (filled.payload.empty()) return PayloadStatus::too_short;
  if (jpeg_) return has_markers(filled.payload) ? PayloadStatus::ok : PayloadStatus::markers;
  const std::size_t needed = luma::payload_bytes(layout_of(format_.encoding), format_.width,
                                                 format_.height, format_.bytes_per_line);
  return filled.payload.size() < needed ? PayloadStatus::too_short : PayloadStatus::ok;
}

PayloadStatus PayloadDecoder::decode(const FilledBuffer& filled, luma::LumaBuffer& out) noexcept {
  if (!jpeg_) {
    const auto status = luma::extract(layout_of(format_.encoding),
                                      format_.full_range ? luma::Range::full : luma::Range::limited,
                                      filled.payload, format_.bytes_per_line, out);
    if (status == luma::ExtractStatus::ok) return PayloadStatus::ok;
    return status == luma::ExtractStatus::short_payload ? PayloadStatus::too_short
                                                        : PayloadStatus::undecodable;
  }
  const mjpeg::Status status = jpeg_->decode(filled.payload, out.data(), out.stride());
  switch (status) {
    case mjpeg::Status::ok:
      return PayloadStatus::ok;
    case mjpeg::Status::empty:
      return PayloadStatus::too_short;
    case mjpeg::Status::not_jpeg:
    case mjpeg::Status::truncated:
      return PayloadStatus::markers;
    default:
      damage_ = mjpeg::describe(status);
      return PayloadStatus::undecodable;
  }
}

}  // namespace dtact::hal::live
