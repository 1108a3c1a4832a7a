#pragma once

namespace dtact::e2e {

/// Factor of the time that programs with sanitizers may take, as in tests/CMakeLists.txt.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr int kSlower = 5;
#else
inline constexpr int kSlower = 1;
#endif

}  // namespace dtact::e2e
