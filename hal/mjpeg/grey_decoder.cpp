#include "hal/mjpeg/grey_decoder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <csetjmp>
#include <stdexcept>

#include "hal/mjpeg/jpeg_arena.hpp"

namespace dtact::hal::mjpeg {
namespace {

constexpr int kMaxSide = 16384;

/// Bytes between two markers that are passed over. Some cameras pad their entropy-coded data before
/// the end marker; a longer rest means that the decoder lost its place.
constexpr int kToleratedStuffing = 16;

/// What libjpeg needs for a single-scan picture: rows of three components in work, at most 4×4
/// subsampled, and tables. 34 kB were measured for 800 pixels in 4:2:0; the rest is margin.
std::size_t arena_bytes(int width) {
  return std::size_t{256} * (1024 + static_cast<std::size_t>(width));
}

Status status_of_error(int code) noexcept {
  switch (code) {
    case JERR_NO_SOI:
      return Status::not_jpeg;
    case JERR_INPUT_EMPTY:
    case JERR_INPUT_EOF:
      return Status::truncated;
    case JERR_ARITH_NOTIMPL:
    case JERR_BAD_PRECISION:
    case JERR_CONVERSION_NOTIMPL:
    case JERR_NOT_COMPILED:
    case JERR_OUT_OF_MEMORY:
    case JERR_SOF_UNSUPPORTED:
      return Status::unsupported;
    default:
      return Status::corrupt;
  }
}

/// Warnings that leave the picture whole.
bool harmless(const jpeg_error_mgr& err) noexcept {
  switch (err.msg_code) {
    case JWRN_ADOBE_XFORM:
    case JWRN_JFIF_MAJOR:
      return true;
    case JWRN_EXTRANEOUS_DATA:
      return err.msg_parm.i[0] <= kToleratedStuffing;
    default:
      return false;
  }
}

}  // namespace

const char* describe(Status status) noexcept {
  switch (status) {
    case Status::ok:
      return "the frame is whole";
    case Status::empty:
      return "the payload is empty";
    case Status::not_jpeg:
      return "the payload is not a JPEG";
    case Status::truncated:
      return "the payload ends before the end-of-image marker";
    case Status::corrupt:
      return "the payload's coded data is broken";
    case Status::wrong_size:
      return "the picture has another size than the camera's mode";
    case Status::unsupported:
      return "the payload is not a baseline JPEG of one interleaved scan";
  }
  return "unknown";
}

struct GreyDecoder::Impl {
  Impl(int w, int h, int s)
      : width(w), height(h), scale(s), crop{0, 0, w / s, h / s}, arena(arena_bytes(w)) {
    cinfo.err = jpeg_std_error(&errors);
    cinfo.client_data = this;
    errors.error_exit = [](j_common_ptr c) {
      Impl& self = *static_cast<Impl*>(c->client_data);
      self.failure = status_of_error(c->err->msg_code);
      std::longjmp(self.way_out, 1);
    };
    errors.emit_message = [](j_common_ptr c, int level) {
      // Negative levels are warnings: the data are damaged and libjpeg would make something up.
      if (level >= 0 || harmless(*c->err)) return;
      c->err->error_exit(c);
    };
    errors.output_message = [](j_common_ptr) {};
    source.init_source = [](j_decompress_ptr) {};
    source.fill_input_buffer = [](j_decompress_ptr c) -> boolean {
      c->err->msg_code = JERR_INPUT_EOF;
      c->err->error_exit(reinterpret_cast<j_common_ptr>(c));
      return FALSE;
    };
    source.skip_input_data = [](j_decompress_ptr c, long bytes) {
      if (bytes <= 0) return;
      if (static_cast<std::size_t>(bytes) > c->src->bytes_in_buffer) c->src->fill_input_buffer(c);
      c->src->next_input_byte += bytes;
      c->src->bytes_in_buffer -= static_cast<std::size_t>(bytes);
    };
    source.resync_to_restart = jpeg_resync_to_restart;
    source.term_source = [](j_decompress_ptr) {};
    if (setjmp(way_out) != 0) throw std::runtime_error("libjpeg cannot be started");
    jpeg_create_decompress(&cinfo);
    cinfo.src = &source;
    arena.attach(cinfo);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    arena.detach(cinfo);
    jpeg_destroy_decompress(&cinfo);
  }

  /// Back to the state after construction; frees nothing, since all memory is the arena's.
  void begin(std::span<const std::uint8_t> payload) noexcept {
    jpeg_abort_decompress(&cinfo);
    arena.reset();
    std::fill(std::begin(cinfo.quant_tbl_ptrs), std::end(cinfo.quant_tbl_ptrs), nullptr);
    std::fill(std::begin(cinfo.dc_huff_tbl_ptrs), std::end(cinfo.dc_huff_tbl_ptrs), nullptr);
    std::fill(std::begin(cinfo.ac_huff_tbl_ptrs), std::end(cinfo.ac_huff_tbl_ptrs), nullptr);
    // A doubled start marker is some cameras' habit and an error to libjpeg.
    constexpr std::array<std::uint8_t, 4> kDoubledStart = {0xFF, 0xD8, 0xFF, 0xD8};
    while (payload.size() >= 4 && std::ranges::equal(payload.first(4), kDoubledStart)) {
      payload = payload.subspan(2);
    }
    source.next_input_byte = payload.data();
    source.bytes_in_buffer = payload.size();
  }

  // No object with a destructor lives in the functions below: longjmp passes them by.
  Status header(std::span<const std::uint8_t> payload) noexcept {
    if (payload.empty()) return Status::empty;
    if (setjmp(way_out) != 0) return failure;
    begin(payload);
    jpeg_read_header(&cinfo, TRUE);
    const bool baseline = cinfo.progressive_mode == 0 && cinfo.arith_code == 0 &&
                          jpeg_has_multiple_scans(&cinfo) == 0;
    return baseline ? Status::ok : Status::unsupported;
  }

  Status pixels(std::uint8_t* luma, std::ptrdiff_t stride) noexcept {
    if (setjmp(way_out) != 0) return failure;
    cinfo.out_color_space = JCS_GRAYSCALE;
    cinfo.scale_num = 1;
    cinfo.scale_denom = static_cast<unsigned>(scale);
    jpeg_start_decompress(&cinfo);
    JDIMENSION left = static_cast<JDIMENSION>(crop.x);
    JDIMENSION columns = static_cast<JDIMENSION>(crop.width);
    // Widens to whole blocks on the left and gives back what it took.
    if (columns < cinfo.output_width) jpeg_crop_scanline(&cinfo, &left, &columns);
    const auto top = static_cast<JDIMENSION>(crop.y);
    const auto bottom = static_cast<JDIMENSION>(crop.y + crop.height);
    if (top > 0) jpeg_skip_scanlines(&cinfo, top);
    read_rows(bottom, luma + left, stride);
    // A skip to the end would leave the rest of the payload unread; the last row is read for that.
    if (bottom + 1 < cinfo.output_height) {
      jpeg_skip_scanlines(&cinfo, cinfo.output_height - bottom - 1);
    }
    read_rows(cinfo.output_height, luma + left, stride);
    jpeg_finish_decompress(&cinfo);
    return Status::ok;
  }

  void read_rows(JDIMENSION end, std::uint8_t* luma, std::ptrdiff_t stride) noexcept {
    while (cinfo.output_scanline < end) {
      // libjpeg hands out at most one row of blocks at a time (rec_outbuf_height ≤ 4 rows).
      std::array<JSAMPROW, 4> rows{};
      const JDIMENSION left = end - cinfo.output_scanline;
      const JDIMENSION count = std::min<JDIMENSION>(rows.size(), left);
      for (JDIMENSION i = 0; i < count; ++i) {
        rows[i] = luma + static_cast<std::ptrdiff_t>(cinfo.output_scanline + i) * stride;
      }
      jpeg_read_scanlines(&cinfo, rows.data(), count);
    }
  }

  int width;   // of the JPEGs
  int height;  // of the JPEGs
  int scale;
  Area crop;
  JpegArena arena;
  jpeg_decompress_struct cinfo{};
  jpeg_error_mgr errors{};
  jpeg_source_mgr source{};
  std::jmp_buf way_out{};
  Status failure = Status::ok;
};

std::string scale_error(int scale, std::string_view pixel_format) {
  if (scale == 1 || pixel_format == "MJPEG") return {};
  return fmt::format(
      "camera.decode_scale = {}: the frames are {}, and only MJPEG is decoded at a smaller size. "
      "Set camera.decode_scale = 1 and a lower reconstruction.resolution, or a mode with MJPEG",
      scale, pixel_format);
}

GreyDecoder::GreyDecoder(int width, int height, int scale) {
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    throw std::invalid_argument("JPEG decoder: width and height must be 1 to 16384 pixels");
  }
  if ((scale != 1 && scale != 2 && scale != 4) || width % scale != 0 || height % scale != 0) {
    throw std::invalid_argument(fmt::format(
        "JPEG decoder: {}x{} pixels cannot be decoded at 1/{} of the size: set camera.decode_scale "
        "to 1, or to 2 or 4 where width and height are multiples of it",
        width, height, scale));
  }
  impl_ = std::make_unique<Impl>(width, height, scale);
}
GreyDecoder::GreyDecoder(GreyDecoder&&) noexcept = default;
GreyDecoder& GreyDecoder::operator=(GreyDecoder&&) noexcept = default;
GreyDecoder::~GreyDecoder() = default;

void GreyDecoder::set_crop(const Area& crop) noexcept {
  Impl& d = *impl_;
  const bool fits = crop.x >= 0 && crop.y >= 0 && crop.width > 0 && crop.height > 0 &&
                    crop.width <= d.width / d.scale - crop.x &&
                    crop.height <= d.height / d.scale - crop.y;
  d.crop = fits ? crop : Area{0, 0, d.width / d.scale, d.height / d.scale};
}

Status GreyDecoder::decode(std::span<const std::uint8_t> payload, std::uint8_t* luma,
                           std::ptrdiff_t stride) noexcept {
  Impl& d = *impl_;
  if (const Status status = d.header(payload); status != Status::ok) return status;
  if (static_cast<int>(d.cinfo.image_width) != d.width ||
      static_cast<int>(d.cinfo.image_height) != d.height) {
    return Status::wrong_size;
  }
  return d.pixels(luma, stride);
}

Status GreyDecoder::read_size(std::span<const std::uint8_t> payload, Size& size) noexcept {
  const Status status = impl_->header(payload);
  if (status == Status::ok) {
    size = {static_cast<int>(impl_->cinfo.image_width),
            static_cast<int>(impl_->cinfo.image_height)};
  }
  return status;
}

}  // namespace dtact::hal::mjpeg
