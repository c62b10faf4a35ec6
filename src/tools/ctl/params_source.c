/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/params_source.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "words/value.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* --- drives ----------------------------------------------------------------------------------- */

/* `reason`: why the drive could not be read now, "" when it was. */
static void ask_drive(struct db_ctl *ctl, const char *name, char *reason, size_t size)
{
	struct db_client_error error = { .parameters = NULL };
	json_t *answer = NULL;

	reason[0] = '\0';
	if (!json_is_true(json_object_get(ctl->description, "may_act"))) {
		snprintf(reason, size, "%s",
		         DB_CTL_TEXT("you may only look, and not have a drive read"));
		return;
	}
	if (db_client_call(ctl->client, "Run",
	                   json_pack("{s:s, s:s, s:b}", "drive", name, "command", "read_parameters",
	                             "until_end", 1),
	                   DB_CTL_DRIVE_TIMEOUT_MS, &answer, &error) != 0)
		snprintf(reason, size, "%s", error.text);
	db_client_error_clear(&error);
	json_decref(answer);
}

enum db_ctl_status db_ctl_params_read_drive(struct db_ctl *ctl, const json_t *families,
                                            const char *name, bool fresh, struct db_params *params)
{
	const json_t *drive = db_ctl_find_drive(ctl, name);
	const json_t *registers = drive ? db_ctl_registers_of(ctl, families, drive) : NULL;
	const json_t *bus = db_words_look_up(json_object_get(ctl->description, "buses"),
	                                     db_words_text(drive, "bus"));
	const char *family = db_words_text(bus, "protocol");
	enum db_ctl_status status = DB_CTL_OK;
	json_t *answer;
	char reason[512] = "";
	char room[DB_WORDS_TEXT_MAX];
	json_int_t oldest_ms;

	*params = (struct db_params){ .values = NULL };
	if (!drive)
		return DB_CTL_USAGE;
	if (fresh)
		ask_drive(ctl, name, reason, sizeof(reason));
	answer = db_ctl_call(
		ctl, "Read",
		json_pack("{s:s, s:o}", "drive", name, "names", db_params_names(registers)),
		DB_CTL_DRIVE_TIMEOUT_MS, &status);
	if (answer && !db_params_take(params, name, family, registers, answer))
		status = db_ctl_complain(ctl, DB_CTL_NO, DB_CLIENT_SERVICE "Refused",
		                         "the parameters of %s are not known now: "
		                         "drivebridgectl status says what it needs",
		                         name);
	json_decref(answer);
	oldest_ms = db_params_oldest_ms(params);
	/* On standard error, also with --json, because standard output may be the file. */
	if (reason[0] && status == DB_CTL_OK && oldest_ms >= 0)
		db_ctl_say_line(stderr,
		                "%s was not read now (%s): its values were read up to %.1f s ago",
		                name, db_ctl_translate(reason, room), (double)oldest_ms / 1000.0);
	else if (reason[0] && status == DB_CTL_OK)
		db_ctl_say_line(stderr,
		                "%s was not read now (%s): how old its values are is not known",
		                name, db_ctl_translate(reason, room));
	return status;
}

enum db_ctl_status db_ctl_params_check_families(const struct db_ctl *ctl,
                                                const struct db_params *one,
                                                const struct db_params *other)
{
	const struct db_params *file = one->family_line > 0 ? one : other;
	const struct db_params *beside = file == one ? other : one;

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

/* --- files ------------------------------------------------------------------------------------ */

/* The whole text, which the caller frees; NULL with the reason. */
static char *read_text(const char *path, const char **problem)
{
	bool is_standard = strcmp(path, "-") == 0;
	FILE *file = is_standard ? stdin : fopen(path, "re");
	char *text = file ? calloc(1, DB_PARAMS_FILE_MAX + 1) : NULL;
	size_t length = text ? fread(text, 1, DB_PARAMS_FILE_MAX, file) : 0;

	*problem = NULL;
	if (!text || ferror(file))
		*problem = strerror(errno);
	else if (length == DB_PARAMS_FILE_MAX)
		*problem = DB_CTL_TEXT("it is too long for a file of parameters");
	else if (strlen(text) < length)
		*problem = DB_CTL_TEXT("it has zero bytes in it: this is no file of parameters");
	if (file && !is_standard)
		(void)fclose(file);
	if (!*problem)
		return text;
	free(text);
	return NULL;
}

enum db_ctl_status db_ctl_params_read_file(const struct db_ctl *ctl, const json_t *families,
                                           const char *path, struct db_params *params)
{
	const char *problem;
	char *text = read_text(path, &problem);
	char *said = NULL;
	size_t length = 0;
	FILE *errors = text ? open_memstream(&said, &length) : NULL;
	bool right = false;

	*params = (struct db_params){ .values = NULL };
	if (errors) {
		right = db_params_read(params, path, text, families, errors);
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
		db_ctl_translate_lines(stderr, said ? said : "drivebridgectl: out of memory\n");
	}
	free(said);
	return right ? DB_CTL_OK : DB_CTL_USAGE;
}
