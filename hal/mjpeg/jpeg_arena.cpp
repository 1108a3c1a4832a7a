#include "hal/mjpeg/jpeg_arena.hpp"

#include <new>

namespace dtact::hal::mjpeg {
namespace {

// libjpeg-turbo's vector code wants 32-byte alignment and may write up to twice that past the end
// of a row of samples.
constexpr std::size_t kAlignment = 64;

constexpr std::size_t round_up(std::size_t bytes) {
  return (bytes + kAlignment - 1) / kAlignment * kAlignment;
}

[[noreturn]] void fail(j_common_ptr cinfo, int code) {
  cinfo->err->msg_code = code;
  cinfo->err->error_exit(cinfo);
  __builtin_unreachable();  // error_exit does not return, by libjpeg's contract
}

}  // namespace

JpegArena::JpegArena(std::size_t bytes)
    : block_(static_cast<std::uint8_t*>(::operator new[](bytes, std::align_val_t{kAlignment}))) {
  manager_.block = block_.get();
  manager_.size = bytes;
  jpeg_memory_mgr& f = manager_.functions;
  f.alloc_small = allocate;
  f.alloc_large = allocate;
  f.alloc_sarray = allocate_samples;
  f.alloc_barray = allocate_blocks;
  f.request_virt_sarray = [](j_common_ptr cinfo, int, boolean, JDIMENSION, JDIMENSION,
                             JDIMENSION) -> jvirt_sarray_ptr { fail(cinfo, JERR_NOT_COMPILED); };
  f.request_virt_barray = [](j_common_ptr cinfo, int, boolean, JDIMENSION, JDIMENSION,
                             JDIMENSION) -> jvirt_barray_ptr { fail(cinfo, JERR_NOT_COMPILED); };
  f.realize_virt_arrays = [](j_common_ptr) {};
  f.access_virt_sarray = [](j_common_ptr cinfo, jvirt_sarray_ptr, JDIMENSION, JDIMENSION,
                            boolean) -> JSAMPARRAY { fail(cinfo, JERR_NOT_COMPILED); };
  f.access_virt_barray = [](j_common_ptr cinfo, jvirt_barray_ptr, JDIMENSION, JDIMENSION,
                            boolean) -> JBLOCKARRAY { fail(cinfo, JERR_NOT_COMPILED); };
  f.free_pool = [](j_common_ptr, int) {};
  f.self_destruct = [](j_common_ptr) {};
  f.max_memory_to_use = static_cast<long>(bytes);
  f.max_alloc_chunk = static_cast<long>(bytes);
}

void JpegArena::attach(jpeg_decompress_struct& cinfo) noexcept {
  original_ = cinfo.mem;
  cinfo.mem = &manager_.functions;
}

void JpegArena::detach(jpeg_decompress_struct& cinfo) noexcept { cinfo.mem = original_; }

JpegArena::Manager& JpegArena::manager_of(j_common_ptr cinfo) noexcept {
  return *reinterpret_cast<Manager*>(cinfo->mem);
}

void* JpegArena::allocate(j_common_ptr cinfo, int /*pool*/, std::size_t bytes) {
  Manager& manager = manager_of(cinfo);
  if (bytes > manager.size || round_up(bytes) > manager.size - manager.used) {
    fail(cinfo, JERR_OUT_OF_MEMORY);
  }
  void* carved = manager.block + manager.used;
  manager.used += round_up(bytes);
  return carved;
}

JSAMPARRAY JpegArena::allocate_samples(j_common_ptr cinfo, int pool, JDIMENSION samples,
                                       JDIMENSION rows) {
  auto* const list = static_cast<JSAMPARRAY>(allocate(cinfo, pool, rows * sizeof(JSAMPROW)));
  const std::size_t row_bytes = round_up(samples * sizeof(JSAMPLE));
  auto* const first = static_cast<JSAMPROW>(allocate(cinfo, pool, row_bytes * rows));
  for (JDIMENSION i = 0; i < rows; ++i) list[i] = first + i * row_bytes;
  return list;
}

JBLOCKARRAY JpegArena::allocate_blocks(j_common_ptr cinfo, int pool, JDIMENSION blocks,
                                       JDIMENSION rows) {
  auto* const list = static_cast<JBLOCKARRAY>(allocate(cinfo, pool, rows * sizeof(JBLOCKROW)));
  auto* const first =
      static_cast<JBLOCKROW>(allocate(cinfo, pool, std::size_t{blocks} * rows * sizeof(JBLOCK)));
  for (JDIMENSION i = 0; i < rows; ++i) list[i] = first + std::size_t{i} * blocks;
  return list;
}

void JpegArena::Free::operator()(std::uint8_t* bytes) const noexcept {
  ::operator delete[](bytes, std::align_val_t{kAlignment});
}

}  // namespace dtact::hal::mjpeg
