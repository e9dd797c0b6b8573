// A harness without a fuzzer: feeds it every file of the folders and files that are named, each
// within 2 GB and a minute.

#include <sys/resource.h>

#include <algorithm>
#include <iostream>
#include <iterator>
#include <vector>

#include "fuzz.h"

int main(int count, char** words) {
  namespace fs = std::filesystem;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadows count, too
  const rlimit memory{rlim_t{2} << 30, rlim_t{2} << 30};
  ::setrlimit(RLIMIT_DATA, &memory);
#endif
  std::vector<fs::path> files;
  for (int i = 1; i < count; ++i) {
    if (fs::is_directory(words[i])) {
      for (const auto& entry : fs::recursive_directory_iterator(words[i]))
        if (entry.is_regular_file()) files.push_back(entry.path());
    } else {
      files.emplace_back(words[i]);
    }
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    std::cout << file.string() << std::endl;  // the last one before a crash is the finding
    std::ifstream stream(file, std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
    ::alarm(60);
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  }
  std::cout << files.size() << " files" << std::endl;
  return files.empty() ? 1 : 0;
}
