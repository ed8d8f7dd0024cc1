#include "fringe_fusion/io/file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <streambuf>
#include <system_error>
#include <utility>

namespace fringe_fusion {
namespace {

namespace fs = std::filesystem;

std::string ErrorText(int error_number) {
  return std::error_code(error_number, std::generic_category()).message();
}

// Stream buffer over a POSIX descriptor: unlike std::filebuf it tells why a write failed and lets
// the caller sync the data before the rename.
class DescriptorBuffer : public std::streambuf {
 public:
  explicit DescriptorBuffer(int descriptor) : descriptor_(descriptor) {
    setp(buffer_.data(), buffer_.data() + buffer_.size());
  }
  ~DescriptorBuffer() override {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  DescriptorBuffer(const DescriptorBuffer&) = delete;
  DescriptorBuffer& operator=(const DescriptorBuffer&) = delete;

  [[nodiscard]] int error() const { return error_; }

  // Writes the rest and closes. False with error() set on failure: some file systems report a full
  // disk only here.
  bool Close(Durability durability) {
    bool ok = sync() == 0;
    // Pipes and terminals cannot be synced (EINVAL, EROFS): that is no loss of data.
    if (ok && durability == Durability::kSynced && ::fsync(descriptor_) != 0 && errno != EINVAL &&
        errno != EROFS)
      ok = Note();
    const int descriptor = std::exchange(descriptor_, -1);
    if (::close(descriptor) != 0 && ok) ok = Note();
    return ok;
  }

 protected:
  int_type overflow(int_type c) override {
    if (sync() != 0) return traits_type::eof();
    if (!traits_type::eq_int_type(c, traits_type::eof())) {
      *pptr() = traits_type::to_char_type(c);
      pbump(1);
    }
    return traits_type::not_eof(c);
  }
  std::streamsize xsputn(const char* data, std::streamsize size) override {
    if (size > epptr() - pptr()) {
      if (sync() != 0) return 0;
      if (size >= static_cast<std::streamsize>(buffer_.size())) {
        return WriteAll(data, static_cast<std::size_t>(size)) ? size : 0;
      }
    }
    std::memcpy(pptr(), data, static_cast<std::size_t>(size));
    pbump(static_cast<int>(size));
    return size;
  }
  int sync() override {
    const bool ok = WriteAll(pbase(), static_cast<std::size_t>(pptr() - pbase()));
    setp(buffer_.data(), buffer_.data() + buffer_.size());
    return ok ? 0 : -1;
  }

 private:
  bool Note() {
    error_ = errno;
    return false;
  }
  bool WriteAll(const char* data, std::size_t size) {
    if (error_ != 0) return false;
    while (size > 0) {
      const ssize_t written = ::write(descriptor_, data, size);
      if (written < 0) {
        if (errno == EINTR) continue;
        return Note();
      }
      data += written;
      size -= static_cast<std::size_t>(written);
    }
    return true;
  }

  int descriptor_;
  int error_ = 0;
  std::array<char, 65536> buffer_{};
};

// Removes a temporary file unless it was renamed.
class TemporaryFile {
 public:
  explicit TemporaryFile(std::string path) : path_(std::move(path)) {}
  ~TemporaryFile() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  void Release() { path_.clear(); }

 private:
  std::string path_;
};

Status WriteTo(int descriptor, const std::string& path,
               const std::function<Status(std::ostream&)>& write, Durability durability) {
  DescriptorBuffer buffer(descriptor);
  std::ostream stream(&buffer);
  Status status = write(stream);
  stream.flush();
  // A failed write explains itself better by its cause than by what the writer made of it.
  if (buffer.error() != 0) return Fail("{}: cannot write: {}", path, ErrorText(buffer.error()));
  if (!status) return status;
  if (!stream) return Fail("{}: cannot write: the stream failed", path);
  if (!buffer.Close(durability)) {
    return Fail("{}: cannot write: {}", path, ErrorText(buffer.error()));
  }
  return {};
}

// Opens a new sibling of `target` for writing; tells its name.
int OpenSibling(const fs::path& target, std::string& sibling) {
  for (int attempt = 0;; ++attempt) {
    const std::string name =
        fmt::format(".{}.{}-{}.part", target.filename().string(), ::getpid(), attempt);
    sibling = (target.parent_path() / name).string();
    const int descriptor = ::open(sibling.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0 || errno != EEXIST) return descriptor;
  }
}

}  // namespace

Status WriteAtomically(const std::string& path, const std::function<Status(std::ostream&)>& write,
                       Durability durability) {
  if (path.empty()) return Fail("cannot write a file without a name");
  std::error_code ignored;
  fs::path target(path);
  // A link stays a link: the file it points to is replaced.
  if (fs::is_symlink(target, ignored)) target = fs::weakly_canonical(target, ignored);
  if (fs::is_directory(target, ignored)) return Fail("{}: cannot write: it is a folder", path);
  if (fs::exists(target, ignored) && !fs::is_regular_file(target, ignored)) {
    // A device or pipe, e.g. /dev/stdout, cannot be replaced: it is written directly.
    const int descriptor = ::open(target.c_str(), O_WRONLY | O_CLOEXEC);
    if (descriptor < 0) return Fail("{}: cannot write: {}", path, ErrorText(errno));
    return WriteTo(descriptor, path, write, durability);
  }
  std::string sibling;
  const int descriptor = OpenSibling(target, sibling);
  if (descriptor < 0) return Fail("{}: cannot write: {}", path, ErrorText(errno));
  TemporaryFile temporary(sibling);
  if (Status status = WriteTo(descriptor, path, write, durability); !status) return status;
  if (::rename(sibling.c_str(), target.c_str()) != 0) {
    return Fail("{}: cannot write: {}", path, ErrorText(errno));
  }
  temporary.Release();
  return {};
}

Result<std::string> ReadFile(const std::string& path) {
  std::error_code code;
  if (fs::is_directory(path, code)) return Fail("{}: cannot be read: it is a folder", path);
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return Fail("{}: cannot be read: {}", path, ErrorText(errno));
  std::string content;
  const std::uintmax_t size = fs::file_size(path, code);
  if (!code) content.reserve(static_cast<std::size_t>(size));
  std::array<char, 65536> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    content.append(block.data(), static_cast<std::size_t>(stream.gcount()));
  }
  if (stream.bad()) return Fail("{}: cannot be read: {}", path, ErrorText(errno));
  return content;
}

Status MakeFolder(const std::string& path) {
  if (path.empty()) return Fail("cannot create a folder without a name");
  std::error_code code;
  fs::create_directories(path, code);
  if (code) return Fail("{}: cannot create the folder: {}", path, code.message());
  if (!fs::is_directory(path, code)) {
    return Fail("{}: cannot create the folder: a file has this name", path);
  }
  return {};
}

}  // namespace fringe_fusion
