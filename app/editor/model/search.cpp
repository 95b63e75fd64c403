#include "app/editor/model/search.h"

#include <algorithm>
#include <cctype>

namespace voxloom::editor {

namespace {

char lower(char c) { return char(std::tolower(static_cast<unsigned char>(c))); }

bool begins_word(std::string_view text, std::size_t i) {
    return i == 0 || !std::isalnum(static_cast<unsigned char>(text[i - 1]));
}

// A hit in the title says more than one in the id, and that more than one in a keyword.
int score(const NodeType& type, std::string_view query) {
    int best = 3 * fuzzy_score(query, type.title);
    best = std::max(best, 2 * fuzzy_score(query, type.id));
    for (const std::string& keyword : type.keywords) best = std::max(best, fuzzy_score(query, keyword));
    return best;
}

}  // namespace

int fuzzy_score(std::string_view query, std::string_view text) {
    int total = 0;
    std::size_t at = 0;
    bool side_by_side = false;
    for (char wanted : query) {
        if (wanted == ' ') continue;
        std::size_t found = at;
        while (found < text.size() && lower(text[found]) != lower(wanted)) ++found;
        if (found == text.size()) return 0;
        // The next beginning of a word is the better hit, unless this one continues a run.
        if (!(side_by_side && found == at))
            for (std::size_t i = found; i < text.size(); ++i)
                if (lower(text[i]) == lower(wanted) && begins_word(text, i)) {
                    found = i;
                    break;
                }
        total += 1 + (found == 0 ? 6 : begins_word(text, found) ? 4 : 0) + (side_by_side && found == at ? 3 : 0);
        at = found + 1;
        side_by_side = true;
    }
    return total;
}

std::vector<const NodeType*> find_nodes(const std::vector<const NodeType*>& types, std::string_view query) {
    struct Hit {
        int score;
        const NodeType* type;
    };
    const bool all = query.find_first_not_of(' ') == std::string_view::npos;
    std::vector<Hit> hits;
    for (const NodeType* type : types)
        if (int s = all ? 1 : score(*type, query)) hits.push_back({s, type});
    std::stable_sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) {
        return a.score != b.score ? a.score > b.score : a.type->title < b.type->title;
    });
    std::vector<const NodeType*> found;
    for (const Hit& hit : hits) found.push_back(hit.type);
    return found;
}

}  // namespace voxloom::editor
