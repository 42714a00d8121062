// Characters of .map text. Private to the reader.
#pragma once
#include <algorithm>
#include <string_view>

namespace kiln::quake {

constexpr bool is_blank(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}

class Scanner {
public:
    explicit Scanner(std::string_view text) : text_(text) {}
    int line() const { return line_; }
    bool at_end() const { return at_ == text_.size(); }

    // The next character that is neither white space nor comment (0: end), not consumed.
    char peek() {
        skip_blanks(true);
        return at_end() ? '\0' : text_[at_];
    }
    // The same on the present line only: '\n' where nothing more stands on it.
    char peek_on_line() {
        skip_blanks(false);
        return at_end() ? '\n' : text_[at_];
    }
    void take() { ++at_; }

    // Text up to white space or one of `stops`.
    std::string_view word(std::string_view stops) {
        const std::size_t first = at_;
        while (!at_end() && !is_blank(text_[at_]) && stops.find(text_[at_]) == std::string_view::npos) ++at_;
        return text_.substr(first, at_ - first);
    }
    // A string after its opening quote; false: its line ends before it does. A backslash guards a quote only if
    // another quote follows on the line, for "C:\dir\" ends there while "say \"hi\"" does not.
    bool string(std::string_view& out) {
        const std::size_t line_end = std::min(text_.find('\n', at_), text_.size());
        const std::string_view rest = text_.substr(at_, line_end - at_);
        std::size_t end = rest.find('"');
        while (end != std::string_view::npos && end > 0 && rest[end - 1] == '\\' &&
               rest.find('"', end + 1) != std::string_view::npos)
            end = rest.find('"', end + 1);
        out = rest.substr(0, end);
        at_ += end == std::string_view::npos ? rest.size() : end + 1;
        return end != std::string_view::npos;
    }
    void skip_line() { at_ = std::min(text_.find('\n', at_), text_.size()); }

private:
    std::string_view text_;
    std::size_t at_ = 0;
    int line_ = 1;

    void skip_blanks(bool over_lines) {
        for (; !at_end(); ++at_) {
            const char c = text_[at_];
            if (c == '\n') {
                if (!over_lines) return;
                ++line_;
            } else if (c == ';' || (c == '/' && at_ + 1 < text_.size() && text_[at_ + 1] == '/')) {
                skip_line(); // ';' begins the comments of QuArK
                --at_;
            } else if (!is_blank(c)) {
                return;
            }
        }
    }
};

} // namespace kiln::quake
