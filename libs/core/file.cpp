#include "libs/core/file.h"
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <random>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace kiln {
namespace {

class Descriptor {
public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() { close(); }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int get() const { return fd_; }
    int close() {
        const int result = fd_ >= 0 ? ::close(fd_) : 0;
        fd_ = -1;
        return result;
    }

private:
    int fd_;
};

Fault io_fault(Exit exit, const char* code, const std::string& path, const std::string& what) {
    return fault(exit, code, fmt::format("{}: {}", what, std::strerror(errno)), {.file = path});
}

} // namespace

void Buffer::Release::operator()(std::uint8_t* data) const {
    if (mapped) ::munmap(data, mapped);
    else delete[] data;
}

Result<Buffer> map_file(const std::string& path) {
    const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    struct stat info {};
    if (file.get() < 0 || ::fstat(file.get(), &info) != 0) return io_fault(Exit::input, "cannot-read", path, "cannot be opened");
    if (!S_ISREG(info.st_mode)) return fault(Exit::input, "cannot-read", "is not a file", {.file = path});
    Buffer out;
    if (info.st_size == 0) return out;
    out.size_ = static_cast<std::size_t>(info.st_size);
    void* const at = ::mmap(nullptr, out.size_, PROT_READ, MAP_PRIVATE | MAP_POPULATE, file.get(), 0);
    if (at == MAP_FAILED) return io_fault(Exit::input, "cannot-read", path, "cannot be mapped");
    out.data_ = {static_cast<std::uint8_t*>(at), Buffer::Release{out.size_}};
    return out;
}

Result<Buffer> read_buffer(const std::string& path) {
    Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (file.get() < 0) return io_fault(Exit::input, "cannot-read", path, "cannot be opened");
    struct stat info {};
    if (::fstat(file.get(), &info) == 0 && S_ISDIR(info.st_mode))
        return fault(Exit::input, "cannot-read", "is a directory", {.file = path});
    // What the file says of its size may be nothing (pipes) or have changed since: one more than that, to see its end.
    constexpr std::size_t kLeast = 65536;
    Buffer room(info.st_size > 0 ? static_cast<std::size_t>(info.st_size) + 1 : kLeast);
    std::size_t size = 0;
    for (;;) {
        if (size == room.fill().size()) {
            Buffer larger(2 * size);
            std::ranges::copy(room.fill(), larger.fill().begin());
            room = std::move(larger);
        }
        const ssize_t got = ::read(file.get(), room.fill().data() + size, room.fill().size() - size);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return io_fault(Exit::input, "cannot-read", path, "cannot be read");
        if (got == 0) break;
        size += static_cast<std::size_t>(got);
    }
    room.keep(0, size);
    return room;
}

Result<Bytes> read_file(const std::string& path) {
    const Result<Buffer> read = read_buffer(path);
    if (!read) return read.fault();
    return Bytes(read->bytes().begin(), read->bytes().end());
}

Result<bool> write_file(const std::string& path, std::initializer_list<std::span<const std::uint8_t>> parts, bool sync) {
    // A device or pipe (/dev/stdout, /dev/full) cannot be renamed onto; everything else is replaced whole.
    std::error_code ignored;
    const auto kind = std::filesystem::status(path, ignored).type();
    const bool direct = kind == std::filesystem::file_type::character || kind == std::filesystem::file_type::fifo ||
                        kind == std::filesystem::file_type::socket;
    // A name of our own: of two that write the same file, neither may write on in what the other has put in place.
    std::string temporary = path;
    int created = -1;
    std::random_device random;
    constexpr int kTries = 16;
    for (int i = 0; i < kTries; ++i) {
        if (!direct) temporary = fmt::format("{}.{:08x}.tmp", path, random());
        created = ::open(temporary.c_str(), O_WRONLY | O_CLOEXEC | (direct ? 0 : O_CREAT | O_EXCL), 0644);
        if (created >= 0 || errno != EEXIST) break;
    }
    Descriptor file(created);
    if (file.get() < 0) return io_fault(Exit::io, "cannot-write", path, "cannot be created");
    const auto failed = [&](const char* what) {
        const Fault f = io_fault(Exit::io, "cannot-write", path, what);
        if (!direct) ::unlink(temporary.c_str());
        return f;
    };
    for (std::span<const std::uint8_t> bytes : parts)
        while (!bytes.empty()) {
            const ssize_t put = ::write(file.get(), bytes.data(), bytes.size());
            if (put < 0 && errno == EINTR) continue;
            if (put < 0) return failed("cannot be written");
            bytes = bytes.subspan(static_cast<std::size_t>(put));
        }
    if (sync && !direct && ::fsync(file.get()) != 0) return failed("cannot be synced");
    if (file.close() != 0) return failed("cannot be closed");
    if (!direct && ::rename(temporary.c_str(), path.c_str()) != 0) return failed("cannot be renamed into place");
    return true;
}

Result<bool> write_file(const std::string& path, std::span<const std::uint8_t> bytes) {
    return write_file(path, {bytes}, true);
}

Result<bool> write_file(const std::string& path, const std::string& text) {
    return write_file(path, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

} // namespace kiln
