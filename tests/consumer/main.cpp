// A C++ program that uses pencilscan as an installed package: it simulates a frame and reconstructs
// it, both in memory, and finds the bytes that the program writes for the same rig and mesh.
//   consumer <program> <folder to work in>

#include <pencilscan/pencilscan.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace {

namespace fs = std::filesystem;
namespace ps = pencilscan;

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

bool run(const std::string& command) {
  std::printf("%s\n", command.c_str());
  std::fflush(stdout);
  return std::system(command.c_str()) == 0;
}

/// While alive, standard output and error go to a file.
class Listener {
 public:
  explicit Listener(const fs::path& path) : path_(path), out_(::dup(1)), error_(::dup(2)) {
    std::fflush(nullptr);
    std::FILE* file = std::fopen(path.c_str(), "wb");
    ::dup2(::fileno(file), 1);
    ::dup2(::fileno(file), 2);
    std::fclose(file);
  }
  std::string heard() {
    std::fflush(nullptr);
    ::dup2(out_, 1);
    ::dup2(error_, 2);
    return bytes_of(path_);
  }

 private:
  fs::path path_;
  int out_;
  int error_;
};

/// Small pictures, so that the test is quick.
ps::Rig small_ring() {
  ps::RingOptions ring;
  ring.cameras = ring.projectors = 4;
  ring.camera_width = 480;
  ring.camera_height = 360;
  ring.camera_focal_px = 860;
  ring.pitch_px = 24;
  ring.line_width_px = 8;
  return ps::make_ring(ring);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::string program = argv[1];
  const fs::path folder = argv[2];
  const std::string rig_path = (folder / "rig.json").string();
  const std::string mesh_path = (folder / "ball.ply").string();
  const std::string scene = (folder / "scene").string();
  const std::string result_folder = (folder / "result").string();

  ps::write_rig(small_ring(), rig_path);
  ps::write_mesh(mesh_path, ps::make_sphere(120, 48));

  Listener listener(folder / "printed.txt");
  const ps::Rig rig = ps::read_rig(rig_path);
  const ps::SimulatedFrame frame = ps::simulate(rig, ps::read_mesh(mesh_path));
  ps::Images images;
  for (const auto& [camera, image] : frame.images) images.emplace(camera, image);
  ps::ReconstructionOptions options;
  options.progress = [](std::string_view, double) { return true; };
  const ps::Reconstruction result = ps::reconstruct(rig, images, options);
  ps::write_reconstruction(folder / "memory", result);
  const std::string printed = listener.heard();
  if (!printed.empty()) {
    std::printf("the library printed: %s\n", printed.c_str());
    return 1;
  }
  std::printf("pencilscan %s: %zu points, %zu faces\n", ps::version(), result.points.size(),
              result.mesh.faces.size());

  if (!run(program + " simulate --noise medium --rig " + rig_path + " --mesh " + mesh_path +
           " --out " + scene) ||
      !run(program + " reconstruct --no-pictures --rig " + rig_path + " --frames " + scene +
           "/frames --out " + result_folder)) {
    return 1;
  }
  bool equal = !result.points.empty() && !result.mesh.faces.empty();
  // The program's report also has hashes of the pictures' files, which are none here.
  for (const char* name : {"points.ply", "curves.ply", "mesh.ply", "mesh_measured.ply"}) {
    const std::string ours = bytes_of(folder / "memory" / name);
    const bool same = !ours.empty() && ours == bytes_of(result_folder + "/000000/" + name);
    std::printf("%s %s\n", name, same ? "equal" : "DIFFERENT");
    equal = equal && same;
  }
  return equal ? 0 : 1;
}
