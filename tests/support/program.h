// Runs the kiln program as a user would: in a folder of its own, with exit code and what it said.
#pragma once
#include <csignal>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace kiln::test {

struct Outcome {
    int code = -1;     // exit code; 128 + signal where it was killed
    std::string said;  // standard error
    std::string out;   // standard output
};

struct Limits {
    long file_bytes = -1; // no file may grow past this, as on a full disk
    int interrupt_after_ms = -1;
};

class Workplace { // a fresh folder that goes away with the test
public:
    Workplace() {
        const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
        folder_ = std::filesystem::temp_directory_path() /
                  ("kiln_" + std::string(info->test_suite_name()) + "_" + info->name() + "_" + std::to_string(::getpid()));
        std::filesystem::remove_all(folder_);
        std::filesystem::create_directories(folder_);
    }
    ~Workplace() { std::filesystem::remove_all(folder_); }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    std::string write(const std::string& name, const std::string& text) const {
        std::ofstream(path(name), std::ios::binary) << text;
        return path(name);
    }
    bool has(const std::string& name) const { return std::filesystem::exists(folder_ / name); }
    std::vector<std::string> files() const {
        std::vector<std::string> names;
        for (const auto& e : std::filesystem::directory_iterator(folder_)) names.push_back(e.path().filename().string());
        std::sort(names.begin(), names.end());
        return names;
    }

    Outcome run(const std::vector<std::string>& words, Limits limits = {}) const {
        // The log files stand outside the folder, so that `files()` shows what the program left behind.
        const std::string log = folder_.string() + ".log", output = folder_.string() + ".out";
        const pid_t child = ::fork();
        if (child == 0) {
            std::vector<char*> argv = {const_cast<char*>(KILN_PROGRAM)};
            for (const std::string& w : words) argv.push_back(const_cast<char*>(w.c_str()));
            argv.push_back(nullptr);
            if (!std::freopen(log.c_str(), "w", stderr) || !std::freopen(output.c_str(), "w", stdout)) ::_exit(99);
            if (limits.file_bytes >= 0) {
                const rlimit limit{static_cast<rlim_t>(limits.file_bytes), static_cast<rlim_t>(limits.file_bytes)};
                ::setrlimit(RLIMIT_FSIZE, &limit);
            }
            ::execv(KILN_PROGRAM, argv.data());
            ::_exit(98);
        }
        if (limits.interrupt_after_ms >= 0) {
            ::usleep(static_cast<useconds_t>(limits.interrupt_after_ms) * 1000);
            ::kill(child, SIGINT);
        }
        int status = 0;
        ::waitpid(child, &status, 0);
        const auto read = [](const std::string& p) {
            std::ifstream f(p, std::ios::binary);
            std::string text((std::istreambuf_iterator<char>(f)), {});
            std::filesystem::remove(p);
            return text;
        };
        return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read(log), read(output)};
    }

private:
    std::filesystem::path folder_;
};

// Quake-family map text of boxes; sides clockwise seen from outside.
inline std::string box(double x0, double y0, double z0, double x1, double y1, double z1, const std::string& texture = "wall") {
    const auto p = [](double x, double y, double z) {
        return "( " + std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + " ) ";
    };
    const std::string tail = texture + " 0 0 0 1 1\n";
    return "{\n" + p(x0, y0, z0) + p(x0, y0 + 1, z0) + p(x0, y0, z0 + 1) + tail + p(x1, y1, z1) + p(x1, y1, z1 + 1) + p(x1, y1 + 1, z1) + tail +
           p(x0, y0, z0) + p(x0, y0, z0 + 1) + p(x0 + 1, y0, z0) + tail + p(x1, y1, z1) + p(x1 + 1, y1, z1) + p(x1, y1, z1 + 1) + tail +
           p(x0, y0, z0) + p(x0 + 1, y0, z0) + p(x0, y0 + 1, z0) + tail + p(x1, y1, z1) + p(x1, y1 + 1, z1) + p(x1 + 1, y1, z1) + tail + "}\n";
}
// Walls 16 thick around the air [0,w] x [0,d] x [0,h].
inline std::string room(double w, double d, double h) {
    return box(-16, -16, -16, w + 16, d + 16, 0) + box(-16, -16, h, w + 16, d + 16, h + 16) + box(-16, -16, 0, 0, d + 16, h) +
           box(w, -16, 0, w + 16, d + 16, h) + box(0, -16, 0, w, 0, h) + box(0, d, 0, w, d + 16, h);
}
inline std::string world(const std::string& brushes) { return "{\n\"classname\" \"worldspawn\"\n" + brushes + "}\n"; }
inline std::string entity(const std::string& classname, double x, double y, double z, const std::string& more = "") {
    return "{\n\"classname\" \"" + classname + "\"\n\"origin\" \"" + std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) +
           "\"\n" + more + "}\n";
}
inline std::string lit_room() {
    return world(room(128, 96, 80)) + entity("info_player_start", 32, 32, 24) + entity("light", 96, 64, 60, "\"light\" \"200\"\n");
}

} // namespace kiln::test
