// Runs a fuzz target without libFuzzer: the files of its corpus, then mutations of them, always the
// same ones. So a compiler without libFuzzer runs it too, as a test of a second.
//
//   fuzz_TARGET CORPUS_FOLDER_OR_FILE [MUTATIONS]
//
// The input under test is in fuzz_TARGET.input in the working directory; it stays
// there when the target ends the program, and can be given as the file.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongest = 65536;  // bytes of a mutated input
/// An input of that length may not need more.
constexpr rlim_t kMaxMemory = rlim_t{2} << 30U;

std::vector<std::string> read_corpus(const fs::path& path) {
  if (!fs::is_directory(path)) return {base::read_file(path)};
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path)) files.push_back(entry.path());
  std::ranges::sort(files);
  std::vector<std::string> corpus;
  corpus.reserve(files.size());
  for (const auto& file : files) corpus.push_back(base::read_file(file));
  if (corpus.empty()) throw std::runtime_error(path.string() + ": no seeds");
  return corpus;
}

class Mutator {
 public:
  explicit Mutator(const std::vector<std::string>& corpus) : corpus_(corpus) {}

  std::string next() {
    std::string input = pick(corpus_);
    for (std::size_t n = 1 + below(5); n > 0; --n) mutate(input);
    if (input.size() > kLongest) input.resize(kLongest);
    return input;
  }

 private:
  // This engine gives the same numbers on every platform, unlike the library's distributions.
  std::size_t below(std::size_t limit) { return static_cast<std::size_t>(random_() % limit); }
  template <typename Lut>
  const typename Lut::value_type& pick(const Lut& lut) {
    return lut[below(lut.size())];
  }

  void mutate(std::string& input) {
    const std::size_t at = below(input.size() + 1);
    const std::size_t length = std::min(input.size() - at, below(16) + 1);
    switch (below(9)) {
      case 0:
        if (at < input.size()) input[at] = static_cast<char>(input[at] ^ (1 << below(8)));
        break;
      case 1:
        if (at < input.size()) input[at] = static_cast<char>(below(256));
        break;
      case 2:
        input.erase(at, length);
        break;
      case 3:
        input.insert(at, input.substr(at, length));
        break;
      case 4:
        input.insert(at, std::string(length, static_cast<char>(below(256))));
        break;
      case 5:
        input.resize(at);
        break;
      case 6:
        splice(input, at);
        break;
      case 7:
        replace_integer(input, at);
        break;
      default:
        replace_number(input, at);
        break;
    }
  }

  /// Copies a piece of another seed over the input from `at` on.
  void splice(std::string& input, std::size_t at) {
    const std::string& other = pick(corpus_);
    const std::size_t from = below(other.size() + 1);
    const std::string piece = other.substr(from, below(256));
    input.replace(at, std::min(piece.size(), input.size() - at), piece);
  }

  /// Replaces one, two or four bytes by a value at a limit, in either byte order.
  void replace_integer(std::string& input, std::size_t at) {
    static constexpr std::array<std::uint32_t, 10> kEdges = {
        0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF};
    const std::size_t bytes = std::size_t{1} << below(3);
    if (input.size() < bytes || at > input.size() - bytes) return;
    const std::uint32_t value = pick(kEdges);
    const bool big = below(2) == 0;
    for (std::size_t i = 0; i < bytes; ++i) {
      const std::size_t shift = 8 * (big ? bytes - 1 - i : i);
      input[at + i] = static_cast<char>(value >> shift);
    }
  }

  /// Replaces the decimal number at or after `at`.
  void replace_number(std::string& input, std::size_t at) {
    static constexpr std::array<const char*, 14> kNumbers = {"0",
                                                             "-1",
                                                             "1",
                                                             "2147483648",
                                                             "9223372036854775807",
                                                             "-9223372036854775808",
                                                             "65536",
                                                             "1e9",
                                                             "nan",
                                                             "inf",
                                                             "1e-300",
                                                             "16384",
                                                             "0.5",
                                                             "1e308"};
    constexpr const char* kDigits = "0123456789.";
    const std::size_t first = input.find_first_of(kDigits, at);
    if (first == std::string::npos) return;
    const std::size_t last = std::min(input.find_first_not_of(kDigits, first), input.size());
    input.replace(first, last - first, pick(kNumbers));
  }

  const std::vector<std::string>& corpus_;
  std::mt19937_64 random_{20260131};
};

void limit_memory() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  const rlimit limit{kMaxMemory, kMaxMemory};
  ::setrlimit(RLIMIT_AS, &limit);
#endif
}

void run(const fs::path& program, const fs::path& corpus_path, std::size_t mutations) {
  const auto corpus = read_corpus(corpus_path);  // first: it may be the record itself
  const std::string record_name = program.filename().string() + ".input";
  const base::UniqueFd record(
      ::open(record_name.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  const auto try_one = [&](const std::string& input) {
    if (::ftruncate(record.get(), static_cast<off_t>(input.size())) != 0 ||
        ::pwrite(record.get(), input.data(), input.size(), 0) !=
            static_cast<ssize_t>(input.size())) {
      throw std::runtime_error("cannot write " + record_name);
    }
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
  };
  for (const auto& seed : corpus) try_one(seed);
  Mutator mutator(corpus);
  for (std::size_t i = 0; i < mutations; ++i) try_one(mutator.next());
  fs::remove(record_name);
  fmt::print("{} seeds and {} mutations\n", corpus.size(), mutations);
}

}  // namespace
}  // namespace dtact::fuzz

int main(int argc, char** argv) {
  std::size_t mutations = 0;
  if (argc == 3) {
    const std::string_view text = argv[2];
    std::from_chars(text.data(), text.data() + text.size(), mutations);
  } else if (argc != 2) {
    fmt::print(stderr, "usage: {} CORPUS_FOLDER_OR_FILE [MUTATIONS]\n", argv[0]);
    return 2;
  }
  dtact::fuzz::limit_memory();
  dtact::fuzz::run(argv[0], argv[1], mutations);
  return 0;
}
