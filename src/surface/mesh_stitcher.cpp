#include "mesh_stitcher.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>

#include "fringe_fusion/io/file.hpp"
#include "io/little_endian.hpp"
#include "io/mesh_formats.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr std::size_t kLabelBytes = 4;
constexpr std::size_t kFaceBytes = 16;

// The columns of a mesh that ExtractMesh makes.
PlyColumns SurfaceColumns() {
  PlyColumns columns;
  columns.normals = columns.colors = columns.sigma = columns.num_views = true;
  return columns;
}

Status WriteBytes(const std::string& bytes, const std::string& path, std::ofstream& file) {
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.flush();
  if (!file) return Fail("{}: {}", path, std::strerror(errno));
  return {};
}

Status ReadBytes(const std::string& path, std::size_t count, std::ifstream& file,
                 std::string& bytes) {
  bytes.resize(count);
  file.read(bytes.data(), static_cast<std::streamsize>(count));
  if (!file) return Fail("{}: cannot be read: {}", path, std::strerror(errno));
  return {};
}

std::int32_t NumberAt(const std::string& bytes, std::size_t at) {
  return static_cast<std::int32_t>(GetUint32(bytes.data() + at));
}

// Calls use(first, bytes) for all rows of a file, some at a time.
template <typename Use>
Status ForEachChunk(const std::string& path, std::size_t row_bytes, std::size_t count,
                    const Use& use) {
  constexpr std::size_t kRows = 1 << 16;
  std::ifstream file(path, std::ios::binary);
  std::string bytes;
  for (std::size_t first = 0; first < count; first += kRows) {
    const std::size_t rows = std::min(kRows, count - first);
    if (Status status = ReadBytes(path, rows * row_bytes, file, bytes); !status) return status;
    use(first, rows, bytes);
  }
  return {};
}

}  // namespace

// The vertices that wait and those of a slab, ascending by their edges.
struct MeshStitcher::Merged {
  struct Vertex {
    int shared = -1;          // index into shared_
    int slab = -1;            // index into the slab
    std::int64_t number = 0;  // ~index into the next shared_, if it waits (again)
  };
  std::vector<Vertex> vertices;
  std::vector<int> of_shared;  // index into vertices
  std::vector<int> of_slab;
};

MeshStitcher::MeshStitcher(const std::string& folder)
    : row_path_(folder + "/vertices.bin"),
      label_path_(folder + "/labels.bin"),
      face_path_(folder + "/faces.bin"),
      rows_(row_path_, std::ios::binary | std::ios::trunc),
      labels_(label_path_, std::ios::binary | std::ios::trunc),
      faces_(face_path_, std::ios::binary | std::ios::trunc) {}

MeshStitcher::Merged MeshStitcher::MergeVertices(const EdgeMesh& slab, int end_x) const {
  Merged merged;
  merged.of_shared.resize(shared_.size());
  merged.of_slab.resize(slab.edges.size());
  auto next_number = static_cast<std::int64_t>(num_vertices_);
  std::int64_t num_waiting = 0;
  std::size_t a = 0;
  std::size_t b = 0;
  while (a < shared_.size() || b < slab.edges.size()) {
    constexpr EdgeKey kNone = std::numeric_limits<EdgeKey>::max();
    const EdgeKey of_shared = a < shared_.size() ? shared_[a].edge : kNone;
    const EdgeKey of_slab = b < slab.edges.size() ? slab.edges[b] : kNone;
    const EdgeKey edge = std::min(of_shared, of_slab);
    Merged::Vertex vertex;
    const auto index = static_cast<int>(merged.vertices.size());
    if (of_shared == edge) {
      merged.of_shared[a] = index;
      vertex.shared = static_cast<int>(a++);
    }
    if (of_slab == edge) {
      merged.of_slab[b] = index;
      vertex.slab = static_cast<int>(b++);
    }
    vertex.number = VoxelColumn(edge) < end_x ? next_number++ : ~(num_waiting++);
    merged.vertices.push_back(vertex);
  }
  return merged;
}

MeshStitcher::Label MeshStitcher::Root(Label label) {
  while (parent_[static_cast<std::size_t>(label)] != label) {
    Label& up = parent_[static_cast<std::size_t>(label)];
    up = parent_[static_cast<std::size_t>(up)];
    label = up;
  }
  return label;
}

// Vertices that faces join have one label; labels that meet become one.
std::vector<MeshStitcher::Label> MeshStitcher::LabelVertices(const EdgeMesh& slab,
                                                             const Merged& merged) {
  std::vector<int> up(merged.vertices.size());
  std::iota(up.begin(), up.end(), 0);
  const auto root = [&](int v) {
    while (up[static_cast<std::size_t>(v)] != v) {
      int& next = up[static_cast<std::size_t>(v)];
      next = up[static_cast<std::size_t>(next)];
      v = next;
    }
    return v;
  };
  for (const Eigen::Vector3i& face : slab.mesh.faces) {
    const int first = root(merged.of_slab[static_cast<std::size_t>(face[0])]);
    for (const int corner : {face[1], face[2]}) {
      up[static_cast<std::size_t>(root(merged.of_slab[static_cast<std::size_t>(corner)]))] =
          root(first);
    }
  }
  constexpr Label kNone = -1;
  std::vector<Label> label_of_root(merged.vertices.size(), kNone);
  for (std::size_t i = 0; i < shared_.size(); ++i) {
    Label& label = label_of_root[static_cast<std::size_t>(root(merged.of_shared[i]))];
    const Label own = Root(shared_[i].label);
    if (label == kNone) {
      label = own;
    } else {
      const Label other = Root(label);
      parent_[static_cast<std::size_t>(std::max(own, other))] = std::min(own, other);
    }
  }
  std::vector<Label> labels(merged.vertices.size());
  for (std::size_t v = 0; v < labels.size(); ++v) {
    Label& label = label_of_root[static_cast<std::size_t>(root(static_cast<int>(v)))];
    if (label == kNone) {
      label = static_cast<Label>(parent_.size());
      parent_.push_back(label);
      face_count_.push_back(0);
    }
    labels[v] = label;
  }
  return labels;
}

// The faces of the slab before: the numbers of all their corners are known now.
Status MeshStitcher::ReleaseFaces(const Merged& merged) {
  std::string bytes;
  std::size_t end_vertex = num_vertices_;
  for (const HeldFace& face : held_) {
    for (std::int64_t corner : face.corners) {
      if (corner < 0) {
        const int index = merged.of_shared[static_cast<std::size_t>(~corner)];
        corner = merged.vertices[static_cast<std::size_t>(index)].number;
      }
      end_vertex = std::max(end_vertex, static_cast<std::size_t>(corner) + 1);
      PutInt32(bytes, static_cast<std::int32_t>(corner));
    }
    PutInt32(bytes, face.label);
  }
  spans_.push_back({held_first_vertex_, end_vertex, held_.size(), 0});
  held_.clear();
  return WriteBytes(bytes, face_path_, faces_);
}

Status MeshStitcher::Add(const EdgeMesh& slab, int end_x) {
  const Merged merged = MergeVertices(slab, end_x);
  const std::vector<Label> labels = LabelVertices(slab, merged);
  if (Status status = ReleaseFaces(merged); !status) return status;
  for (const Eigen::Vector3i& face : slab.mesh.faces) {
    HeldFace held;
    for (int k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(merged.of_slab[static_cast<std::size_t>(face[k])]);
      held.corners[static_cast<std::size_t>(k)] = merged.vertices[v].number;
      held.label = labels[v];
    }
    ++face_count_[static_cast<std::size_t>(held.label)];
    held_.push_back(held);
  }
  held_first_vertex_ = num_vertices_;
  std::string rows;
  std::string label_bytes;
  std::vector<Shared> waiting;
  for (std::size_t v = 0; v < merged.vertices.size(); ++v) {
    const Merged::Vertex& vertex = merged.vertices[v];
    std::string row;
    if (vertex.slab >= 0) {
      PutPlyVertex(slab.mesh, static_cast<std::size_t>(vertex.slab), row);
    } else {
      row = shared_[static_cast<std::size_t>(vertex.shared)].row;
    }
    row_bytes_ = row.size();
    if (vertex.number < 0) {
      const EdgeKey edge = vertex.slab >= 0 ? slab.edges[static_cast<std::size_t>(vertex.slab)]
                                            : shared_[static_cast<std::size_t>(vertex.shared)].edge;
      waiting.push_back({edge, std::move(row), labels[v]});
      continue;
    }
    rows += row;
    PutInt32(label_bytes, labels[v]);
    ++num_vertices_;
  }
  shared_ = std::move(waiting);
  if (num_vertices_ + shared_.size() > std::numeric_limits<std::int32_t>::max()) {
    return Fail("the mesh has more than {} vertices: use a larger voxel",
                std::numeric_limits<std::int32_t>::max());
  }
  if (Status status = WriteBytes(rows, row_path_, rows_); !status) return status;
  return WriteBytes(label_bytes, label_path_, labels_);
}

std::vector<std::uint8_t> MeshStitcher::KeptLabels(int min_faces) {
  std::vector<std::int64_t> counts(parent_.size(), 0);
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    counts[static_cast<std::size_t>(Root(static_cast<Label>(i)))] += face_count_[i];
  }
  std::vector<std::uint8_t> kept(parent_.size());
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    const std::int64_t count = counts[static_cast<std::size_t>(Root(static_cast<Label>(i)))];
    kept[i] = count > 0 && count >= min_faces ? 1 : 0;
  }
  face_count_ = std::move(counts);
  return kept;
}

Status MeshStitcher::CountKept(const std::vector<std::uint8_t>& kept, Figures& figures) {
  std::size_t span = 0;
  Status read = ForEachChunk(
      label_path_, kLabelBytes, num_vertices_,
      [&](std::size_t first, std::size_t rows, const std::string& bytes) {
        for (std::size_t i = 0; i < rows; ++i) {
          while (span < spans_.size() && spans_[span].first_vertex == first + i) {
            spans_[span++].kept_before = figures.num_vertices;
          }
          figures.num_vertices += kept[static_cast<std::size_t>(NumberAt(bytes, i * kLabelBytes))];
        }
      });
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    const bool is_root = parent_[i] == static_cast<Label>(i);
    if (!is_root || face_count_[i] == 0) continue;
    ++figures.num_components;
    if (kept[i] != 0) figures.num_faces += static_cast<std::size_t>(face_count_[i]);
  }
  return read;
}

Status MeshStitcher::CopyVertices(const std::vector<std::uint8_t>& kept, std::ostream& stream) {
  std::ifstream labels(label_path_, std::ios::binary);
  std::string label_bytes;
  Status status;
  Status copied = ForEachChunk(
      row_path_, row_bytes_, num_vertices_,
      [&](std::size_t /*first*/, std::size_t rows, const std::string& bytes) {
        if (status) status = ReadBytes(label_path_, rows * kLabelBytes, labels, label_bytes);
        for (std::size_t i = 0; status && i < rows; ++i) {
          const std::int32_t label = NumberAt(label_bytes, i * kLabelBytes);
          if (kept[static_cast<std::size_t>(label)] == 0) continue;
          stream.write(bytes.data() + i * row_bytes_, static_cast<std::streamsize>(row_bytes_));
        }
      });
  return status ? copied : status;
}

Status MeshStitcher::CopyFaces(const std::vector<std::uint8_t>& kept, std::ostream& stream) {
  std::ifstream faces(face_path_, std::ios::binary);
  std::string labels;
  std::string bytes;
  for (const Span& span : spans_) {
    std::ifstream label_file(label_path_, std::ios::binary);
    label_file.seekg(static_cast<std::streamoff>(span.first_vertex * kLabelBytes));
    const std::size_t num_labels = span.end_vertex - span.first_vertex;
    if (Status status = ReadBytes(label_path_, num_labels * kLabelBytes, label_file, labels);
        !status) {
      return status;
    }
    std::vector<std::int32_t> numbers(num_labels);
    auto next = static_cast<std::int32_t>(span.kept_before);
    for (std::size_t i = 0; i < num_labels; ++i) {
      numbers[i] = next;
      next += kept[static_cast<std::size_t>(NumberAt(labels, i * kLabelBytes))];
    }
    if (Status status = ReadBytes(face_path_, span.num_faces * kFaceBytes, faces, bytes); !status) {
      return status;
    }
    std::string rows;
    for (std::size_t f = 0; f < span.num_faces; ++f) {
      const std::size_t at = f * kFaceBytes;
      if (kept[static_cast<std::size_t>(NumberAt(bytes, at + 12))] == 0) continue;
      PutByte(rows, 3);
      for (std::size_t k = 0; k < 3; ++k) {
        const auto corner = static_cast<std::size_t>(NumberAt(bytes, at + 4 * k));
        PutInt32(rows, numbers[corner - span.first_vertex]);
      }
    }
    stream.write(rows.data(), static_cast<std::streamsize>(rows.size()));
  }
  return {};
}

Result<MeshStitcher::Figures> MeshStitcher::Finish(const std::string& path,
                                                   int min_component_faces) {
  if (Status status = Add({}, std::numeric_limits<int>::max()); !status) return Forward(status);
  if (Status status = ReleaseFaces({}); !status) return Forward(status);
  const std::vector<std::uint8_t> kept = KeptLabels(min_component_faces);
  Figures figures;
  if (Status status = CountKept(kept, figures); !status) return Forward(status);
  if (figures.num_faces == 0) {
    const auto largest = std::max_element(face_count_.begin(), face_count_.end());
    return Fail("surface: the largest of {} pieces has {} faces, limit min_component_faces = {}",
                figures.num_components, largest == face_count_.end() ? 0 : *largest,
                min_component_faces);
  }
  Status written = WriteAtomically(path, [&](std::ostream& stream) -> Status {
    const std::string header =
        MeshPlyHeader(figures.num_vertices, figures.num_faces, SurfaceColumns());
    stream.write(header.data(), static_cast<std::streamsize>(header.size()));
    if (Status status = CopyVertices(kept, stream); !status) return status;
    return CopyFaces(kept, stream);
  });
  if (!written) return Forward(written);
  return figures;
}

}  // namespace fringe_fusion::internal
