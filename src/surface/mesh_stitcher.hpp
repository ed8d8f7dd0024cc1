#pragma once

#include <array>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "edge_mesh.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::internal {

/// Joins the meshes of slabs, ascending in x, to one PLY file: the bytes that the whole mesh would
/// have. Memory holds one slab; vertices and faces wait in scratch files.
class MeshStitcher {
 public:
  struct Figures {
    std::size_t num_vertices = 0;
    std::size_t num_faces = 0;
    int num_components = 0;  ///< before the small ones are removed
  };

  /// @param folder of the scratch files; the caller removes it.
  explicit MeshStitcher(const std::string& folder);

  /// @param slab the cells of the voxel columns before end_x that no slab before had.
  /// @return error naming the file that cannot be written.
  [[nodiscard]] Status Add(const EdgeMesh& slab, int end_x);

  /// Writes the mesh without its pieces of fewer faces; the file appears whole or not at all.
  /// @return error naming path and cause, or that nothing remains.
  [[nodiscard]] Result<Figures> Finish(const std::string& path, int min_component_faces);

 private:
  using Label = std::int32_t;  // of a piece; several labels may turn out to be one piece

  // A vertex in the plane between two slabs, which both may use.
  struct Shared {
    EdgeKey edge = 0;
    std::string row;
    Label label = 0;
  };
  // Corners are numbers of vertices, or ~index into shared_.
  struct HeldFace {
    std::array<std::int64_t, 3> corners{};
    Label label = 0;
  };
  // The faces of one slab in their file.
  struct Span {
    std::size_t first_vertex = 0;  // that they use
    std::size_t end_vertex = 0;
    std::size_t num_faces = 0;
    std::size_t kept_before = 0;  // vertices that stay, before the first
  };
  struct Merged;

  [[nodiscard]] Merged MergeVertices(const EdgeMesh& slab, int end_x) const;
  [[nodiscard]] std::vector<Label> LabelVertices(const EdgeMesh& slab, const Merged& merged);
  [[nodiscard]] Status ReleaseFaces(const Merged& merged);
  [[nodiscard]] Label Root(Label label);
  [[nodiscard]] std::vector<std::uint8_t> KeptLabels(int min_faces);
  [[nodiscard]] Status CountKept(const std::vector<std::uint8_t>& kept, Figures& figures);
  [[nodiscard]] Status CopyVertices(const std::vector<std::uint8_t>& kept, std::ostream& stream);
  [[nodiscard]] Status CopyFaces(const std::vector<std::uint8_t>& kept, std::ostream& stream);

  std::string row_path_;
  std::string label_path_;
  std::string face_path_;
  std::ofstream rows_;    // vertices as the PLY file has them
  std::ofstream labels_;  // of the vertices
  std::ofstream faces_;   // three corners and a label, int32 each
  std::vector<Shared> shared_;
  std::vector<HeldFace> held_;
  std::size_t held_first_vertex_ = 0;
  std::vector<Span> spans_;
  std::size_t num_vertices_ = 0;
  std::size_t row_bytes_ = 0;
  std::vector<Label> parent_;             // of each label
  std::vector<std::int64_t> face_count_;  // of each label, in the end of its root
};

}  // namespace fringe_fusion::internal
