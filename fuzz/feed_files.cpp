// A harness without a fuzzer: feeds it every file of the folders and files that are named, each
// within 2 GB and a minute. With --mutate SECONDS also what becomes of them by chance: bytes
// changed, cut out, doubled, or taken from another file. It does not see which code runs, as a
// fuzzer does, but needs no Clang. What ends the process is left in ./found.

#include <fcntl.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <random>
#include <vector>

#include "fuzz.h"

namespace {

namespace fs = std::filesystem;

std::string current;  ///< the input that is being fed

/// Leaves the input; then the signal does what it ever does.
extern "C" void leave_input(int signal) {
  const int file = ::open("found", O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file >= 0) {
    const ssize_t written = ::write(file, current.data(), current.size());
    static_cast<void>(written);
  }
  ::raise(signal);
}

void feed(std::string input) {
  current = std::move(input);
  ::alarm(60);
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(current.data()), current.size());
}

const std::array<std::string_view, 22> kPieces = {"1e300",
                                                  "-1e300",
                                                  "1e-320",
                                                  "nan",
                                                  "inf",
                                                  "-1",
                                                  "0",
                                                  "4294967295",
                                                  "18446744073709551615",
                                                  "2147483648",
                                                  "65500",
                                                  "[[",
                                                  "{}",
                                                  "null",
                                                  "\"\"",
                                                  "\0",
                                                  "\xff\xff\xff\xff",
                                                  "\x7f\xff\xff\xff",
                                                  "%00",
                                                  "..",
                                                  "\n\n",
                                                  ","};

class Mutator {
 public:
  Mutator(std::vector<std::string> inputs, unsigned seed)
      : inputs_(std::move(inputs)), random_(seed) {}

  std::string next() {
    std::string input = inputs_[below(inputs_.size())];
    for (std::size_t changes = 1 + below(8); changes > 0; --changes) change(input);
    constexpr std::size_t kLongest = 1 << 16;
    if (input.size() > kLongest) input.resize(kLongest);
    return input;
  }

 private:
  std::size_t below(std::size_t count) { return count == 0 ? 0 : random_() % count; }

  void change(std::string& input) {
    const std::size_t at = below(input.size() + 1);
    const std::size_t length = std::min(below(input.size() + 1), std::size_t{1} << below(10));
    switch (below(6)) {
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
        input.insert(at, input.substr(below(input.size() + 1), length));
        break;
      case 4: {
        const std::string& other = inputs_[below(inputs_.size())];
        input.insert(at, other.substr(below(other.size() + 1), length));
        break;
      }
      default: {
        const std::string_view piece = kPieces[below(kPieces.size())];
        input.replace(at, std::min(length, piece.size()), piece);
      }
    }
  }

  std::vector<std::string> inputs_;
  std::mt19937 random_;
};

std::vector<fs::path> files_of(const std::vector<std::string>& places) {
  std::vector<fs::path> files;
  for (const std::string& place : places) {
    if (!fs::is_directory(place)) {
      files.emplace_back(place);
      continue;
    }
    for (const auto& entry : fs::recursive_directory_iterator(place))
      if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

int main(int count, char** words) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadows count, too
  const rlimit memory{rlim_t{2} << 30, rlim_t{2} << 30};
  ::setrlimit(RLIMIT_DATA, &memory);
#endif
  struct sigaction action {};
  action.sa_handler = leave_input;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGABRT, SIGSEGV, SIGFPE, SIGILL, SIGBUS, SIGALRM})
    ::sigaction(signal, &action, nullptr);
  std::vector<std::string> places(words + 1, words + count);
  double seconds = 0;
  if (places.size() > 2 && places[0] == "--mutate") {
    seconds = std::atof(places[1].c_str());
    places.erase(places.begin(), places.begin() + 2);
  }
  std::vector<std::string> inputs;
  for (const fs::path& file : files_of(places)) {
    std::cout << file.string() << std::endl;  // the last one before a crash is the finding
    std::ifstream stream(file, std::ios::binary);
    inputs.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>{});
    feed(inputs.back());
  }
  std::cout << inputs.size() << " files" << std::endl;
  if (inputs.empty()) return 1;
  const auto begin = std::chrono::steady_clock::now();
  const auto passed = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const unsigned seed = seconds > 0 ? std::random_device()() : 0;
  Mutator mutator(std::move(inputs), seed);
  std::size_t executions = 0;
  for (; passed() < seconds; ++executions) feed(mutator.next());
  if (seconds > 0) std::cout << executions << " executions, seed " << seed << std::endl;
  return 0;
}
