#include "nodes/truth_folder.hpp"

#include <ostream>
#include <utility>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"

namespace fringe_fusion::nodes {

Result<TruthFolder> TruthFolder::Create(const std::string& path, const Mesh& object) {
  if (Status status = MakeFolder(path); !status) return tl::unexpected<Error>(status.error());
  TruthFolder folder(path, object.faces.size());
  if (Status status = WriteMesh(object, path + "/object.ply"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (Status status = folder.AddStop(folder.face_visible_); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return folder;
}

Status TruthFolder::AddStop(const std::vector<std::uint8_t>& face_visible) {
  if (face_visible.size() != face_visible_.size()) {
    return Fail("{}: {} visible faces given, the object has {}", path_, face_visible.size(),
                face_visible_.size());
  }
  std::string text;
  text.reserve(2 * face_visible_.size());
  for (std::size_t i = 0; i < face_visible_.size(); ++i) {
    if (face_visible[i] != 0) face_visible_[i] = 1;
    text += face_visible_[i] != 0 ? "1\n" : "0\n";
  }
  return WriteAtomically(
      path_ + "/face_visible.txt",
      [&text](std::ostream& stream) -> Status {
        stream << text;
        return {};
      },
      Durability::kClosed);
}

}  // namespace fringe_fusion::nodes
