#include "formats/portal_file/portal_file.h"
#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <optional>
#include <string_view>

namespace kiln {
namespace {

// White space separates; parentheses stand for themselves. Knows its line.
class Tokens {
public:
    Tokens(std::span<const std::uint8_t> bytes) : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()) {}
    int line() const { return line_; }
    std::string_view next() { // empty: the end
        skip_space();
        const std::size_t begin = at_;
        if (at_ < text_.size() && is_bracket(text_[at_])) ++at_;
        else
            while (at_ < text_.size() && !is_space(text_[at_]) && !is_bracket(text_[at_])) ++at_;
        return text_.substr(begin, at_ - begin);
    }
    std::string_view peek() {
        const std::size_t at = at_;
        const int line = line_;
        const std::string_view token = next();
        at_ = at, line_ = line;
        return token;
    }
    std::size_t left() const { return text_.size() - at_; }

private:
    std::string_view text_;
    std::size_t at_ = 0;
    int line_ = 1;
    static bool is_space(char c) { return static_cast<unsigned char>(c) <= ' '; }
    static bool is_bracket(char c) { return c == '(' || c == ')'; }
    void skip_space() {
        for (; at_ < text_.size() && is_space(text_[at_]); ++at_) line_ += text_[at_] == '\n';
    }
};

struct Trouble {
    std::string code, message;
    int line;
};

template <class T> T number(Tokens& tokens, const char* what) {
    const std::string_view token = tokens.next();
    T value{};
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
    if (token.empty()) throw Trouble{"portal-file-truncated", fmt::format("the file ends before {}", what), tokens.line()};
    if (error != std::errc{} || end != token.data() + token.size())
        throw Trouble{"portal-file-syntax", fmt::format("'{}' is not {}", token.substr(0, 40), what), tokens.line()};
    if constexpr (std::is_floating_point_v<T>)
        if (!std::isfinite(value))
            throw Trouble{"portal-file-syntax", fmt::format("{} is not finite", what), tokens.line()};
    return value;
}

void expect(Tokens& tokens, std::string_view what) {
    const std::string_view token = tokens.next();
    if (token.empty()) throw Trouble{"portal-file-truncated", fmt::format("the file ends before '{}'", what), tokens.line()};
    if (token != what)
        throw Trouble{"portal-file-syntax", fmt::format("'{}' where '{}' was to come", token.substr(0, 40), what),
                      tokens.line()};
}

// The winding is clockwise seen from the first cluster; turned around the first point.
void turn(std::vector<Vec3>& winding) {
    if (winding.size() > 1) std::reverse(winding.begin() + 1, winding.end());
}

FilePortal read_portal(Tokens& tokens, std::uint32_t cluster_count) {
    FilePortal p;
    const auto count = number<std::uint32_t>(tokens, "a number of points");
    p.front = number<std::uint32_t>(tokens, "a cluster");
    p.back = number<std::uint32_t>(tokens, "a cluster");
    if (p.front >= cluster_count || p.back >= cluster_count)
        throw Trouble{"portal-file-cluster",
                      fmt::format("portal between clusters {} and {} of {}", p.front, p.back, cluster_count),
                      tokens.line()};
    if (count < 3) throw Trouble{"portal-file-winding", fmt::format("a portal of {} points", count), tokens.line()};
    if (const std::string_view mark = tokens.peek(); mark == "h" || mark == "n" || mark == "0" || mark == "1")
        p.hint = mark == "h" || mark == "1", tokens.next();
    for (std::uint32_t i = 0; i < count; ++i) {
        expect(tokens, "(");
        Vec3 v;
        for (std::size_t k = 0; k < 3; ++k) v[k] = number<double>(tokens, "a coordinate");
        expect(tokens, ")");
        p.winding.push_back(v);
    }
    turn(p.winding);
    return p;
}

PortalFile read(Tokens& tokens) {
    const std::string_view magic = tokens.next();
    if (magic != "PRT1" && magic != "PRT2" && magic != "PRT1-AM")
        throw Trouble{"portal-file-magic", "not a portal file: it does not start with PRT1, PRT1-AM or PRT2",
                      tokens.line()};
    PortalFile file;
    std::uint32_t leaves = 0, portals = 0;
    if (magic == "PRT2") leaves = number<std::uint32_t>(tokens, "a number of leaves");
    file.cluster_count = number<std::uint32_t>(tokens, "a number of clusters");
    portals = number<std::uint32_t>(tokens, "a number of portals");
    if (magic == "PRT1-AM") leaves = number<std::uint32_t>(tokens, "a number of leaves");
    for (std::uint32_t i = 0; i < portals; ++i) file.portals.push_back(read_portal(tokens, file.cluster_count));
    if (leaves > tokens.left()) // a leaf takes at least one digit
        throw Trouble{"portal-file-truncated", "the file ends before the clusters of its leaves", tokens.line()};
    file.leaf_cluster.assign(leaves, UINT32_MAX);
    if (magic == "PRT2") {
        for (std::uint32_t c = 0; c < file.cluster_count; ++c)
            for (;;) {
                const auto leaf = number<std::int64_t>(tokens, "a leaf or -1");
                if (leaf < 0) break;
                if (leaf >= leaves)
                    throw Trouble{"portal-file-cluster", fmt::format("leaf {} of {}", leaf, leaves), tokens.line()};
                file.leaf_cluster[static_cast<std::size_t>(leaf)] = c;
            }
    } else {
        for (std::uint32_t& c : file.leaf_cluster) {
            c = number<std::uint32_t>(tokens, "a cluster");
            if (c >= file.cluster_count)
                throw Trouble{"portal-file-cluster", fmt::format("cluster {} of {}", c, file.cluster_count), tokens.line()};
        }
    }
    if (std::ranges::find(file.leaf_cluster, UINT32_MAX) != file.leaf_cluster.end())
        throw Trouble{"portal-file-cluster", "a leaf without a cluster", tokens.line()};
    if (!tokens.next().empty())
        throw Trouble{"portal-file-syntax", "text after the last portal", tokens.line()};
    return file;
}

// The shortest text that reads back as the same number; no "-0".
void put(std::string& out, double x) { fmt::format_to(std::back_inserter(out), "{}", x == 0 ? 0.0 : x); }

void put_line(std::string& out, Vec3 p) {
    put(out, p.x), out += ' ', put(out, p.y), out += ' ', put(out, p.z), out += '\n';
}

} // namespace

Result<PortalFile> read_portal_file(std::span<const std::uint8_t> bytes, const std::string& file) {
    Tokens tokens(bytes);
    try {
        return read(tokens);
    } catch (const Trouble& t) {
        return fault(Exit::input, t.code, t.message, {.file = file, .line = t.line});
    }
}

std::string write_portal_file(const PortalFile& file) {
    std::string out;
    const auto to = std::back_inserter(out);
    if (file.leaf_cluster.empty()) fmt::format_to(to, "PRT1\n{}\n{}\n", file.cluster_count, file.portals.size());
    else
        fmt::format_to(to, "PRT2\n{}\n{}\n{}\n", file.leaf_cluster.size(), file.cluster_count, file.portals.size());
    for (const FilePortal& p : file.portals) {
        fmt::format_to(to, "{} {} {} ", p.winding.size(), p.front, p.back);
        std::vector<Vec3> winding = p.winding;
        turn(winding);
        for (const Vec3& v : winding) {
            out += '(';
            for (std::size_t k = 0; k < 3; ++k) put(out, v[k]), out += ' ';
            out += ") ";
        }
        out += '\n';
    }
    if (!file.leaf_cluster.empty()) {
        std::vector<std::vector<std::size_t>> leaves(file.cluster_count);
        for (std::size_t l = 0; l < file.leaf_cluster.size(); ++l) leaves.at(file.leaf_cluster[l]).push_back(l);
        for (const auto& cluster : leaves) {
            for (const std::size_t l : cluster) fmt::format_to(to, "{} ", l);
            out += "-1\n";
        }
    }
    return out;
}

std::string write_pts(std::span<const Vec3> path, double spacing) {
    std::string out;
    for (std::size_t i = 0; i < path.size(); ++i) {
        put_line(out, path[i]);
        if (i + 1 == path.size()) break;
        const double steps = spacing > 0 ? std::ceil(length(path[i + 1] - path[i]) / spacing) : 1;
        for (double s = 1; s < std::min(steps, 100000.0); ++s) put_line(out, path[i] + (path[i + 1] - path[i]) * (s / steps));
    }
    return out;
}

std::string write_lin(std::span<const Vec3> path) {
    const std::vector<Vec3> inwards(path.rbegin(), path.rend());
    return write_pts(inwards, 0);
}

Result<std::vector<Vec3>> read_trail(std::span<const std::uint8_t> bytes, const std::string& file) {
    Tokens tokens(bytes);
    std::vector<Vec3> path;
    try {
        while (!tokens.peek().empty()) {
            Vec3 v;
            for (std::size_t k = 0; k < 3; ++k) v[k] = number<double>(tokens, "a coordinate");
            path.push_back(v);
        }
    } catch (const Trouble& t) {
        return fault(Exit::input, t.code, t.message, {.file = file, .line = t.line});
    }
    return path;
}

} // namespace kiln
