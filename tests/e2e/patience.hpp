#pragma once

namespace dtact::e2e {

/// Factor of the time that programs with sanitizers may take, as in tests/CMakeLists.txt.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr int kSlower = 5;
#else
inline constexpr int kSlower = 1;
#endif

/// Frames a second: with sanitizers as many whole pictures as a shared core can process.
inline constexpr unsigned kFps = kSlower == 1 ? 60 : 20;

}  // namespace dtact::e2e
