/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/tree.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Adds a branch below another one. A second branch of the same name is left out: it could not be
 * addressed. False without memory. */
static bool add(struct db_opcua_tree *tree, size_t parent, enum db_opcua_branch_type type,
                const char *name, size_t place)
{
	struct db_opcua_branch *above = &tree->list[parent];
	struct db_opcua_branch *grown;
	char *path;

	for (size_t i = above->first; i < tree->count; i++) {
		if (strcmp(tree->list[i].name, name) == 0)
			return true;
	}
	if (asprintf(&path, "%s%s%s", above->path, above->path[0] ? "." : "", name) < 0)
		return false;
	grown = realloc(tree->list, (tree->count + 1) * sizeof(*grown));
	if (!grown) {
		free(path);
		return false;
	}
	tree->list = grown;
	tree->list[tree->count++] = (struct db_opcua_branch){
		.type = type,
		.path = path,
		.name = path + strlen(path) - strlen(name),
		.parent = parent,
		.place = place,
	};
	return true;
}

/* Buses have nodes of their own, with their names. */
static bool is_of_bus(const char *name)
{
	return ((strncmp(name, "bus", 3) == 0 && name[3] >= '0' && name[3] <= '9') ||
	        (strncmp(name, "line", 4) == 0 && name[4] >= '0' && name[4] <= '9'));
}

static bool add_variables(struct db_opcua_tree *tree, size_t parent, enum db_opcua_group group,
                          bool gateway)
{
	const struct db_opcua_kind *kind = tree->kind;
	bool good = true;

	for (size_t i = 0; i < kind->count && good; i++) {
		if (kind->list[i].group == group && !(gateway && is_of_bus(kind->list[i].name)))
			good = add(tree, parent, DB_OPCUA_VARIABLE, kind->list[i].shown, i);
	}
	return good;
}

static bool has_group(const struct db_opcua_kind *kind, enum db_opcua_group group)
{
	for (size_t i = 0; i < kind->count; i++) {
		if (kind->list[i].group == group)
			return true;
	}
	return false;
}

static bool add_to_root(struct db_opcua_tree *tree, const struct db_opcua_config *config,
                        bool gateway)
{
	const struct db_opcua_kind *kind = tree->kind;
	bool good = add_variables(tree, 0, DB_OPCUA_PROCESS, gateway);

	if (gateway && good)
		good = add(tree, 0, DB_OPCUA_CLOCK, "Clock", 0) &&
		       add(tree, 0, DB_OPCUA_CERTIFICATE_ENDS, "CertificateEnds", 0);
	for (size_t i = 0; i < json_array_size(kind->commands) && good; i++) {
		char name[DB_OPCUA_NAME_MAX];

		db_opcua_name_of(json_string_value(json_object_get(
					 json_array_get(kind->commands, i), "name")),
		                 name);
		good = add(tree, 0, DB_OPCUA_METHOD, name, i);
	}
	for (int i = DB_OPCUA_COMMAND; i < DB_OPCUA_GROUPS && good; i++) {
		enum db_opcua_group group = (enum db_opcua_group)i;

		if (db_opcua_config_shows(config, group) && has_group(kind, group))
			good = add(tree, 0, DB_OPCUA_FOLDER, db_opcua_group_folder(group),
			           (size_t)group);
	}
	if (!gateway && good)
		good = add(tree, 0, DB_OPCUA_IDENTIFICATION, "Identification", 0);
	return good;
}

static bool add_children(struct db_opcua_tree *tree, size_t parent,
                         const struct db_opcua_config *config, bool gateway)
{
	enum db_opcua_group group = (enum db_opcua_group)tree->list[parent].place;
	size_t place = tree->list[parent].place;
	const struct db_opcua_register *reg;
	bool good = true;

	switch (tree->list[parent].type) {
	case DB_OPCUA_ROOT:
		return add_to_root(tree, config, gateway);
	case DB_OPCUA_FOLDER:
		if (group != DB_OPCUA_HISTORY)
			return add_variables(tree, parent, group, gateway);
		for (size_t i = 0; i < tree->kind->column_count && good; i++)
			good = add(tree, parent, DB_OPCUA_COLUMN, tree->kind->columns[i].shown, i);
		return good;
	case DB_OPCUA_VARIABLE:
		reg = &tree->kind->list[place];
		if (reg->unit[0] != '\0')
			good = add(tree, parent, DB_OPCUA_UNIT, "EngineeringUnits", place);
		/* The names of values are the data type's. */
		if (good && !reg->data && !reg->codes && reg->has_range &&
		    !db_opcua_register_is_open(reg))
			good = add(tree, parent, DB_OPCUA_RANGE, "EURange", place);
		return good;
	case DB_OPCUA_METHOD:
		if (json_array_size(json_object_get(json_array_get(tree->kind->commands, place),
		                                    "arguments")) > 0)
			good = add(tree, parent, DB_OPCUA_INPUTS, "InputArguments", place);
		return good && add(tree, parent, DB_OPCUA_OUTPUTS, "OutputArguments", place);
	case DB_OPCUA_IDENTIFICATION:
		good = add(tree, parent, DB_OPCUA_COMPONENT_NAME, "ComponentName", 0) &&
		       add(tree, parent, DB_OPCUA_LOCATION, "Location", 0);
		if (good && db_opcua_type_has_vendor(tree->kind->type))
			good = add(tree, parent, DB_OPCUA_MODEL, "Model", 0) &&
			       add(tree, parent, DB_OPCUA_SOFTWARE_REVISION, "SoftwareRevision", 0);
		return good;
	default:
		return true;
	}
}

static int compare_paths(const void *a, const void *b, void *data)
{
	const struct db_opcua_branch *list = data;

	return strcmp(list[*(const size_t *)a].path, list[*(const size_t *)b].path);
}

struct db_opcua_tree *db_opcua_tree_new(const struct db_opcua_kind *kind,
                                        const struct db_opcua_config *config, bool gateway)
{
	struct db_opcua_tree *tree = calloc(1, sizeof(*tree));
	char *path = strdup("");
	bool good = tree && path;

	if (good)
		tree->list = calloc(1, sizeof(*tree->list));
	if (!good || !tree->list) {
		free(path);
		free(tree);
		return NULL;
	}
	tree->kind = kind;
	tree->list[0] =
		(struct db_opcua_branch){ .type = DB_OPCUA_ROOT, .path = path, .name = path };
	tree->count = 1;
	/* The children of each branch are appended: so siblings are adjacent. */
	for (size_t i = 0; i < tree->count && good; i++) {
		tree->list[i].first = tree->count;
		good = add_children(tree, i, config, gateway);
		tree->list[i].count = tree->count - tree->list[i].first;
	}
	/* The root is there in any case; clang's analyzer cannot know. */
	tree->sorted = good && tree->count > 0 ? calloc(tree->count, sizeof(*tree->sorted)) : NULL;
	if (!tree->sorted) {
		db_opcua_tree_free(tree);
		return NULL;
	}
	for (size_t i = 0; i < tree->count; i++)
		tree->sorted[i] = i;
	qsort_r(tree->sorted, tree->count, sizeof(*tree->sorted), compare_paths, tree->list);
	return tree;
}

void db_opcua_tree_free(struct db_opcua_tree *tree)
{
	if (!tree)
		return;
	for (size_t i = 0; i < tree->count; i++)
		free(tree->list[i].path);
	free(tree->list);
	free(tree->sorted);
	free(tree);
}

const struct db_opcua_branch *db_opcua_tree_find(const struct db_opcua_tree *tree, const char *path,
                                                 size_t length)
{
	size_t low = 0;
	size_t high = tree->count;

	while (low < high) {
		size_t middle = (low + high) / 2;
		const struct db_opcua_branch *branch = &tree->list[tree->sorted[middle]];
		int order = strncmp(path, branch->path, length);

		/* Equal up to the end of the one; the other one is longer. */
		if (order == 0 && branch->path[length] != '\0')
			order = -1;
		if (order == 0)
			return branch;
		if (order < 0)
			high = middle;
		else
			low = middle + 1;
	}
	return NULL;
}

const json_t *db_opcua_tree_command(const struct db_opcua_tree *tree,
                                    const struct db_opcua_branch *method)
{
	return json_array_get(tree->kind->commands, method->place);
}
