// compiler/FEATURES.md says of each feature which test shows it: the tests it names must be there.
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <regex>
#include <set>
#include <sstream>
#include <string>

namespace {

std::string text_of(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::ostringstream out;
    out << in.rdbuf();
    return out.str();
}

std::set<std::string> tests_of_the_tree() {
    std::set<std::string> names;
    const std::regex head(R"(\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\)|\badd_test\(NAME (\w+)\.(\w+))");
    for (const auto& entry : std::filesystem::recursive_directory_iterator(std::filesystem::path(KILN_SOURCE_DIR) / "tests")) {
        const auto ending = entry.path().extension();
        if (ending != ".cpp" && ending != ".h" && ending != ".txt") continue;
        const std::string text = text_of(entry.path());
        for (std::sregex_iterator it(text.begin(), text.end(), head), end; it != end; ++it) names.insert((*it)[1].str() + (*it)[3].str() + "." + (*it)[2].str() + (*it)[4].str());
    }
    return names;
}

TEST(Features, EveryRowSaysDoneWithATestThatExistsOrWhyNot) {
    const std::set<std::string> tests = tests_of_the_tree();
    std::istringstream table(text_of(std::filesystem::path(KILN_SOURCE_DIR) / "compiler/FEATURES.md"));
    const std::regex name(R"(`([A-Z]\w+\.\w+)`)");
    std::size_t rows = 0;
    for (std::string line; std::getline(table, line);) {
        if (!line.starts_with("| ") || line.starts_with("| ---") || line.starts_with("| feature")) continue;
        ++rows;
        std::vector<std::string> cells;
        std::istringstream in(line.substr(2));
        for (std::string cell; std::getline(in, cell, '|');) cells.push_back(cell);
        ASSERT_GE(cells.size(), 2u) << line;
        const std::string& state = cells[1];
        std::size_t named = 0;
        for (std::sregex_iterator it(state.begin(), state.end(), name), end; it != end; ++it, ++named)
            EXPECT_TRUE(tests.contains((*it)[1].str())) << "there is no test " << (*it)[1] << ":\n" << line;
        const bool done = state.starts_with(" done"), excused = state.starts_with(" not meant") || state.starts_with(" open");
        EXPECT_TRUE(done || excused) << "neither done, not meant nor open:\n" << line;
        if (done) EXPECT_GT(named, 0u) << "done, but by which test?\n" << line;
    }
    EXPECT_GT(rows, 100u);
}

} // namespace
