/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/params_source.h"
#include "ctl/plant.h"
#include "ctl/value.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* --- pure ------------------------------------------------------------------------------------------- */

void db_ctl_params_take_defaults(const struct db_ctl_params *like, struct db_ctl_params *params)
{
	size_t i;
	const json_t *reg;

	*params = (struct db_ctl_params){ .name = "default",
		                          .values = json_object(),
		                          .registers = like->registers };
	json_array_foreach(like->registers, i, reg)
	{
		json_t *preset = json_object_get(reg, "default");

		if (json_is_number(preset))
			(void)json_object_set(params->values, db_ctl_text(reg, "name"), preset);
	}
}

const json_t *db_ctl_params_value(const struct db_ctl_params *params, const char *name)
{
	const json_t *value = json_object_get(params->values, name);

	return json_is_number(value) ? value : NULL;
}

bool db_ctl_params_agree(const struct db_ctl_params *one, const struct db_ctl_params *other,
                         const char *name)
{
	const json_t *value = db_ctl_params_value(one, name);
	const json_t *beside = db_ctl_params_value(other, name);
	double difference;

	if (!value || !beside)
		return value == beside;
	if (json_is_integer(value) && json_is_integer(beside))
		return json_integer_value(value) == json_integer_value(beside);
	/* What is not whole is of single precision in the drive. */
	difference = (double)(float)json_number_value(value) -
	             (double)(float)json_number_value(beside);
	return !(difference < 0.0 || difference > 0.0);
}

/* Every name that one of both may say something of. */
static json_t *list_names(const struct db_ctl_params *one, const struct db_ctl_params *other)
{
	const json_t *registers = one->registers ? one->registers : other->registers;
	json_t *names = json_array();
	const char *name;
	size_t i;
	json_t *item;

	json_array_foreach(registers, i, item)
	{
		if (db_ctl_params_is_kept(item))
			(void)json_array_append(names, json_object_get(item, "name"));
	}
	if (registers)
		return names;
	json_object_foreach(one->values, name, item)(void)
		json_array_append_new(names, json_string(name));
	json_object_foreach(other->values, name, item)
	{
		if (!json_object_get(one->values, name))
			(void)json_array_append_new(names, json_string(name));
	}
	return names;
}

json_t *db_ctl_params_compare(const struct db_ctl_params *one, const struct db_ctl_params *other)
{
	bool of_defaults = strcmp(one->name, "default") == 0 || strcmp(other->name, "default") == 0;
	json_t *names = list_names(one, other);
	json_t *differ = json_array();
	size_t i;
	json_t *item;

	json_array_foreach(names, i, item)
	{
		const char *name = json_string_value(item);

		if (!db_ctl_params_agree(one, other, name) &&
		    !(of_defaults &&
		      (!db_ctl_params_value(one, name) || !db_ctl_params_value(other, name))))
			(void)json_array_append(differ, item);
	}
	json_decref(names);
	return differ;
}

/* The first of those that are written, or the last; 1 for what is in between. */
static int rank_of(const json_t *reg)
{
	return db_ctl_params_has_trait(reg, "first") ? 0 :
	       db_ctl_params_has_trait(reg, "last")  ? 2 :
	                                               1;
}

json_t *db_ctl_params_plan(const struct db_ctl_params *drive, const struct db_ctl_params *file,
                           bool addresses)
{
	json_t *differ = db_ctl_params_compare(drive, file);
	json_t *plan = json_array();

	for (int rank = 0; rank <= 2; rank++) {
		json_t *group = NULL; /* the latest, while more may join it */
		size_t i;
		json_t *name;

		json_array_foreach(differ, i, name)
		{
			const json_t *reg = db_ctl_look_up(drive->registers,
			                                   json_string_value(name));

			if (rank_of(reg) != rank ||
			    !db_ctl_params_value(file, json_string_value(name)) ||
			    db_ctl_params_has_trait(reg, "state") ||
			    db_ctl_params_has_trait(reg, "address") != addresses)
				continue;
			if (group && db_ctl_params_has_trait(reg, "together")) {
				(void)json_array_append(group, name);
				continue;
			}
			group = json_pack("[O]", name);
			(void)json_array_append_new(plan, group);
			if (!db_ctl_params_has_trait(reg, "together"))
				group = NULL;
		}
	}
	json_decref(differ);
	return plan;
}

json_t *db_ctl_params_states(const struct db_ctl_params *drive, const struct db_ctl_params *file)
{
	json_t *differ = db_ctl_params_compare(drive, file);
	json_t *states = json_array();
	size_t i;
	json_t *name;

	json_array_foreach(differ, i, name)
	{
		const json_t *reg = db_ctl_look_up(drive->registers, json_string_value(name));

		if (db_ctl_params_has_trait(reg, "state") &&
		    db_ctl_params_value(file, json_string_value(name)))
			(void)json_array_append(states, name);
	}
	json_decref(differ);
	return states;
}

/* --- drives ----------------------------------------------------------------------------------------- */

static const char *family_of(const struct db_ctl *ctl, const json_t *drive)
{
	const json_t *bus = db_ctl_look_up(json_object_get(ctl->description, "buses"),
	                                   db_ctl_text(drive, "bus"));

	return db_ctl_text(bus, "protocol");
}

enum db_ctl_status db_ctl_params_read_drive(struct db_ctl *ctl, const json_t *families,
                                            const char *name, struct db_ctl_params *params)
{
	const json_t *drive = db_ctl_find_drive(ctl, name);
	json_t *names = json_pack("[s,s]", "status", "identity");
	enum db_ctl_status status = DB_CTL_OK;
	json_t *answer;
	json_t *values;
	size_t i;
	const json_t *reg;

	*params = (struct db_ctl_params){
		.registers = drive ? db_ctl_registers_of(ctl, families, drive) : NULL
	};
	if (!drive) {
		json_decref(names);
		return DB_CTL_USAGE;
	}
	(void)snprintf(params->name, sizeof(params->name), "%s", name);
	(void)snprintf(params->family, sizeof(params->family), "%s", family_of(ctl, drive));
	json_array_foreach(params->registers, i, reg)
	{
		if (json_is_true(json_object_get(reg, "parameter")))
			(void)json_array_append(names, json_object_get(reg, "name"));
	}
	answer = db_ctl_call(ctl, "Read", json_pack("{s:s, s:o}", "drive", name, "names", names),
	                     DB_CTL_DRIVE_TIMEOUT_MS, &status);
	values = json_object_get(answer, "values");
	if (values && !db_ctl_has_bit(db_ctl_look_up(params->registers, "status"),
	                              json_object_get(values, "status"), "params_valid"))
		status = db_ctl_complain(ctl, DB_CTL_NO, DB_CLIENT_SERVICE "Refused",
		                         "the parameters of %s are not known now: "
		                         "drivebridgectl status says what it needs",
		                         name);
	if (values) {
		(void)snprintf(params->identity, sizeof(params->identity), "%s",
		               db_ctl_text(values, "identity"));
		params->values = json_incref(values);
		params->missing = json_incref(json_object_get(answer, "missing"));
	}
	json_decref(answer);
	return status;
}

enum db_ctl_status db_ctl_params_check_families(const struct db_ctl *ctl,
                                                const struct db_ctl_params *one,
                                                const struct db_ctl_params *other)
{
	const struct db_ctl_params *file = one->family_line > 0 ? one : other;
	const struct db_ctl_params *beside = file == one ? other : one;

	if (strcmp(one->family, other->family) == 0)
		return DB_CTL_OK;
	if (file->family_line == 0)
		return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "%s is %s, and %s is %s", file->name, file->family,
		                       beside->name, beside->family);
	return db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.BadFile",
	                       "%s:%u: these are parameters of %s, and %s is %s", file->name,
	                       file->family_line, file->family, beside->name, beside->family);
}

/* --- files ------------------------------------------------------------------------------------------ */

/* All of it, which the caller frees; NULL with the reason. */
static char *read_text(const char *path, const char **problem)
{
	bool is_standard = strcmp(path, "-") == 0;
	FILE *file = is_standard ? stdin : fopen(path, "re");
	char *text = file ? calloc(1, DB_CTL_PARAMS_FILE_MAX + 1) : NULL;
	size_t length = text ? fread(text, 1, DB_CTL_PARAMS_FILE_MAX, file) : 0;

	*problem = NULL;
	if (!text || ferror(file))
		*problem = strerror(errno);
	else if (length == DB_CTL_PARAMS_FILE_MAX)
		*problem = "it is too long for a file of parameters";
	else if (strlen(text) < length)
		*problem = "it has zero bytes in it: this is no file of parameters";
	if (file && !is_standard)
		(void)fclose(file);
	if (!*problem)
		return text;
	free(text);
	return NULL;
}

enum db_ctl_status db_ctl_params_read_file(const struct db_ctl *ctl, const json_t *families,
                                           const char *path, struct db_ctl_params *params)
{
	const char *problem;
	char *text = read_text(path, &problem);
	char *said = NULL;
	size_t length = 0;
	FILE *errors = text ? open_memstream(&said, &length) : NULL;
	bool right = false;

	*params = (struct db_ctl_params){ .values = NULL };
	if (errors) {
		right = db_ctl_params_read(params, path, text, families, errors);
		(void)fclose(errors);
	}
	free(text);
	if (!right && problem) {
		(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.BadFile", "%s: %s",
		                      path, problem);
	} else if (!right && ctl->json) {
		(void)db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.BadFile", "%s",
		                      said ? said : "out of memory");
	} else if (!right) {
		(void)fputs(said ? said : "drivebridgectl: out of memory\n", stderr);
	}
	free(said);
	return right ? DB_CTL_OK : DB_CTL_USAGE;
}

enum db_ctl_status db_ctl_params_find(struct db_ctl *ctl, const json_t *families, const char *name,
                                      struct db_ctl_params *params)
{
	if (db_ctl_look_up(json_object_get(ctl->description, "drives"), name))
		return db_ctl_params_read_drive(ctl, families, name, params);
	return db_ctl_params_read_file(ctl, families, name, params);
}
