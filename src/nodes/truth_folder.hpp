#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::nodes {

/// The true surface on disk for tests and the demo: object.ply, and face_visible.txt with 0 or 1
/// per face of it: 1 where some stop of the scan had it in sight of camera and projector.
class TruthFolder {
 public:
  /// Writes object.ply; creates the folder. @return error naming the path.
  [[nodiscard]] static Result<TruthFolder> Create(const std::string& path, const Mesh& object);

  /// Adds what one more stop sees and writes face_visible.txt anew.
  /// @return error naming the path, or for another number of faces.
  [[nodiscard]] Status AddStop(const std::vector<std::uint8_t>& face_visible);

 private:
  explicit TruthFolder(std::string path, std::size_t num_faces)
      : path_(std::move(path)), face_visible_(num_faces, 0) {}

  std::string path_;
  std::vector<std::uint8_t> face_visible_;
};

}  // namespace fringe_fusion::nodes
