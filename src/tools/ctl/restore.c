/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/say.h"

#include <errno.h>
#include <glob.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define FILE_ERROR "io.drivebridge.Client.File"
#define TEXT_MAX 1048576

struct restore {
	struct db_ctl *ctl;
	const char *file;
	char folder[PATH_MAX]; /* of the configuration on this machine */
	/* next to it, on the same file system, so that a rename puts the unpacked files in place */
	char staging[PATH_MAX];
	char main_file[256];
	json_t *texts; /* of the configuration's files, by path */
	json_t *ports; /* named by these files */
	json_t *others;
};

static void remove_all(char *path)
{
	char rm[] = "rm";
	char all[] = "-rf";
	char *words[] = { rm, all, path, NULL };

	(void)db_ctl_child_run(words, true);
}

/* --- what is in it ---------------------------------------------------------------------------- */

static enum db_ctl_status unpack(const struct restore *restore)
{
	char file[PATH_MAX];
	char staging[PATH_MAX];
	char tar[] = "tar";
	char extract[] = "--extract";
	char gzip[] = "--gzip";
	char permissions[] = "--same-permissions";
	/* Otherwise tar takes a colon in the file's name for a remote host. */
	char local[] = "--force-local";
	char from[] = "--file";
	char into[] = "--directory";
	char *words[] = { tar, extract, gzip, permissions, local, from, file, into, staging, NULL };

	snprintf(file, sizeof(file), "%s", restore->file);
	snprintf(staging, sizeof(staging), "%s", restore->staging);
	return db_ctl_child_run(words, false) ?
	               DB_CTL_OK :
	               db_ctl_complain(restore->ctl, DB_CTL_NO, FILE_ERROR,
	                               "%s cannot be unpacked; nothing was changed", restore->file);
}

/* The whole text of a file; NULL: errno has the reason. */
static char *read_text(const char *path)
{
	FILE *in = fopen(path, "re");
	char *text = in ? calloc(1, TEXT_MAX + 1) : NULL;
	size_t length = text ? fread(text, 1, TEXT_MAX + 1, in) : 0;

	if (in)
		(void)fclose(in);
	if (length <= TEXT_MAX)
		return text;
	free(text);
	errno = EFBIG;
	return NULL;
}

static enum db_ctl_status read_head(struct restore *restore)
{
	char path[PATH_MAX + 16];
	char *text;
	char end = '\0';
	bool right;

	snprintf(path, sizeof(path), "%s/gateway", restore->staging);
	text = read_text(path);
	right = text &&
	        sscanf(text, DB_CTL_BACKUP_HEAD "\n%255[^/\n]%c", restore->main_file, &end) == 2 &&
	        end == '\n' && restore->main_file[0] != '.';
	free(text);
	return right ? DB_CTL_OK :
	               db_ctl_complain(restore->ctl, DB_CTL_NO, FILE_ERROR,
	                               "%s is no backup of drivebridgectl; nothing was changed",
	                               restore->file);
}

/* Reads the files of the configuration whose paths there are like these. */
static enum db_ctl_status read_files(struct restore *restore, const char *paths)
{
	char pattern[PATH_MAX + 64];
	glob_t found = { .gl_pathc = 0 };
	enum db_ctl_status status = DB_CTL_OK;

	snprintf(pattern, sizeof(pattern), "%s/configuration/%s", restore->staging, paths);
	(void)glob(pattern, 0, NULL, &found);
	for (size_t i = 0; status == DB_CTL_OK && i < found.gl_pathc; i++) {
		char *text = read_text(found.gl_pathv[i]);

		if (!text) {
			status = db_ctl_fail_file(restore->ctl, found.gl_pathv[i]);
			break;
		}
		db_ctl_ports_find(text, restore->ports);
		(void)json_object_set_new(restore->texts, found.gl_pathv[i], json_string(text));
		free(text);
	}
	globfree(&found);
	return status;
}

/* --- the ports of this machine ---------------------------------------------------------------- */

/* Reads --ports OLD=NEW,OLD=NEW. */
static enum db_ctl_status read_option(const struct restore *restore)
{
	const char *at = restore->ctl->ports;

	while (at && *at) {
		size_t length = strcspn(at, ",");
		size_t equals = strcspn(at, "=");
		char old[PATH_MAX];

		if (equals == 0 || equals + 1 >= length || equals >= sizeof(old))
			return db_ctl_complain(restore->ctl, DB_CTL_USAGE,
			                       "io.drivebridge.Client.Usage",
			                       "--ports %s: right is OLD=NEW, with commas between",
			                       restore->ctl->ports);
		snprintf(old, sizeof(old), "%.*s", (int)equals, at);
		(void)json_object_set_new(restore->others, old,
		                          json_stringn(at + equals + 1, length - equals - 1));
		at += length + (at[length] == ',' ? 1 : 0);
	}
	return DB_CTL_OK;
}

static enum db_ctl_status ask_for_port(const struct restore *restore, const char *port)
{
	glob_t here = { .gl_pathc = 0 };
	char line[PATH_MAX] = "";
	unsigned long number;
	char *end = NULL;

	if (restore->ctl->yes || restore->ctl->json || !isatty(STDIN_FILENO))
		return db_ctl_complain(restore->ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                       "%s is not on this machine: say --ports %s=DEVICE, with the "
		                       "device that it is here",
		                       port, port);
	(void)glob("/dev/serial/by-id/"
	           "*",
	           0, NULL, &here);
	db_ctl_say_line(stdout, "%s is not on this machine, which has", port);
	for (size_t i = 0; i < here.gl_pathc; i++)
		printf("  %zu  %s\n", i + 1, here.gl_pathv[i]);
	if (here.gl_pathc == 0)
		db_ctl_say_line(
			stdout,
			"  no serial adapter: plug it in and start again, or name a device");
	fputs(db_ctl_say("which one is it (a number, a path, Enter: leave it as it is)?"), stdout);
	fputc(' ', stdout);
	(void)fflush(stdout);
	if (!fgets(line, sizeof(line), stdin))
		line[0] = '\0';
	line[strcspn(line, "\r\n")] = '\0';
	number = strtoul(line, &end, 10);
	if (line[0] == '/')
		(void)json_object_set_new(restore->others, port, json_string(line));
	else if (end != line && number >= 1 && number <= here.gl_pathc)
		(void)json_object_set_new(restore->others, port,
		                          json_string(here.gl_pathv[number - 1]));
	globfree(&here);
	return DB_CTL_OK;
}

static enum db_ctl_status choose_ports(const struct restore *restore)
{
	enum db_ctl_status status = read_option(restore);
	size_t i;
	const json_t *port;

	json_array_foreach(restore->ports, i, port)
	{
		const char *name = json_string_value(port);

		if (status == DB_CTL_OK && !json_object_get(restore->others, name) &&
		    access(name, F_OK) != 0)
			status = ask_for_port(restore, name);
	}
	return status;
}

/* Into the existing files, so that their owners and modes stay. */
static enum db_ctl_status write_files(const struct restore *restore)
{
	enum db_ctl_status status = DB_CTL_OK;
	const char *path;
	const json_t *text;

	json_object_foreach(restore->texts, path, text)
	{
		char *other = db_ctl_ports_replace(json_string_value(text), restore->others);
		FILE *out = other && strcmp(other, json_string_value(text)) != 0 ?
		                    fopen(path, "we") :
		                    NULL;
		bool failed = !other || (out && fputs(other, out) == EOF) ||
		              (!out && strcmp(other, json_string_value(text)) != 0);

		if (out)
			failed = fclose(out) != 0 || failed;
		free(other);
		if (failed && status == DB_CTL_OK)
			status = db_ctl_fail_file(restore->ctl, path);
	}
	return status;
}

/* --- in its place ----------------------------------------------------------------------------- */

/* Lets the service check it: with a mistake, nothing is done. */
static enum db_ctl_status check(const struct restore *restore)
{
	char program[PATH_MAX];
	char check_it[] = "--check";
	char config[] = "--config";
	char path[PATH_MAX + 512];
	char *words[] = { program, check_it, config, path, NULL };

	db_ctl_find_service(program, sizeof(program));
	snprintf(path, sizeof(path), "%s/configuration/%s", restore->staging, restore->main_file);
	return db_ctl_child_run(words, true) ?
	               DB_CTL_OK :
	               db_ctl_complain(restore->ctl, DB_CTL_NO, "io.drivebridge.Client.Wrong",
	                               "the configuration of %s is not right here; nothing was "
	                               "changed",
	                               restore->file);
}

/* `folder` is replaced by the unpacked folder `name`; the former content stays next to it as
 * `kept`. */
static enum db_ctl_status exchange(const struct restore *restore, const char *name,
                                   const char *folder, const char *kept)
{
	char from[PATH_MAX + 32];

	snprintf(from, sizeof(from), "%s/%s", restore->staging, name);
	if (rename(folder, kept) != 0 && errno != ENOENT)
		return db_ctl_fail_file(restore->ctl, folder);
	if (rename(from, folder) == 0)
		return DB_CTL_OK;
	/* Restore the former state. */
	(void)db_ctl_fail_file(restore->ctl, folder);
	(void)rename(kept, folder);
	return DB_CTL_NO;
}

/* Its state may be on another file system: copied, not renamed. */
static void copy_opcua(const struct restore *restore)
{
	char cp[] = "cp";
	char all[] = "-a";
	char to[] = DB_CTL_OPCUA_FOLDER "/";
	char from[PATH_MAX + 32];
	char *words[] = { cp, all, from, to, NULL };

	snprintf(from, sizeof(from), "%s/opcua/.", restore->staging);
	if (access(from, F_OK) != 0 || strcmp(restore->folder, DB_CTL_CONFIGURATION_FOLDER) != 0)
		return;
	if (access(to, F_OK) != 0 || !db_ctl_child_run(words, false))
		db_ctl_say_line(
			stderr,
			"without the certificates of drivebridge-opcua, which is not installed "
			"here: install it and restore again");
}

static enum db_ctl_status put_in_place(const struct restore *restore)
{
	char kept[PATH_MAX + 64];
	char parameters[PATH_MAX + 32];
	char in_configuration[PATH_MAX + 64];
	time_t now = time(NULL);
	struct tm local;
	char when[32] = "";
	enum db_ctl_status status;

	if (localtime_r(&now, &local))
		(void)strftime(when, sizeof(when), "%Y%m%d-%H%M%S", &local);
	snprintf(kept, sizeof(kept), "%s.before-%s", restore->folder, when);
	snprintf(parameters, sizeof(parameters), "%s/parameters", restore->staging);
	snprintf(in_configuration, sizeof(in_configuration), "%s/configuration/parameters",
	         restore->staging);
	/* Copies that an earlier restore left in the configuration are older. */
	remove_all(in_configuration);
	(void)rename(parameters, in_configuration);
	copy_opcua(restore);
	status = exchange(restore, "configuration", restore->folder, kept);
	if (status != DB_CTL_OK || restore->ctl->json)
		return status;
	db_ctl_say_line(stdout, "%s is as in %s; what was there is in %s", restore->folder,
	                restore->file, kept);
	db_ctl_say_line(stdout,
	                "parameters of the drives are in %s/parameters: drivebridgectl params "
	                "restore DRIVE FILE writes "
	                "them into a drive that has others",
	                restore->folder);
	db_ctl_say_line(stdout, "now: sudo systemctl restart drivebridge, and drivebridge-web, "
	                        "-mqtt and -opcua where they run");
	return status;
}

static enum db_ctl_status carry_out(struct restore *restore)
{
	enum db_ctl_status status = unpack(restore);

	if (status == DB_CTL_OK)
		status = read_head(restore);
	if (status == DB_CTL_OK)
		status = read_files(restore, "*.conf");
	if (status == DB_CTL_OK)
		status = read_files(restore, "conf.d/*.conf");
	/* Texts of before stay as they were. */
	if (status == DB_CTL_OK)
		status = read_files(restore, "edited/edited.conf");
	if (status == DB_CTL_OK)
		status = choose_ports(restore);
	if (status == DB_CTL_OK)
		status = write_files(restore);
	if (status == DB_CTL_OK)
		status = check(restore);
	if (status == DB_CTL_OK)
		status = db_ctl_ask(
			restore->ctl,
			"%s becomes what is in %s, and what is there now is kept beside "
			"it; go on?",
			restore->folder, restore->file);
	return status == DB_CTL_OK ? put_in_place(restore) : status;
}

enum db_ctl_status db_ctl_restore(struct db_ctl *ctl, int count, char **arguments)
{
	struct restore restore = {
		.ctl = ctl,
		.file = arguments[0],
		.texts = json_object(),
		.ports = json_array(),
		.others = json_object(),
	};
	enum db_ctl_status status;
	size_t length;

	snprintf(restore.folder, sizeof(restore.folder) - 32, "%s",
	         count > 1 ? arguments[1] : DB_CTL_CONFIGURATION_FOLDER);
	length = strlen(restore.folder);
	while (length > 1 && restore.folder[length - 1] == '/')
		restore.folder[--length] = '\0';
	snprintf(restore.staging, sizeof(restore.staging), "%.*s.restore-XXXXXX", (int)length,
	         restore.folder);
	if (mkdtemp(restore.staging)) {
		status = carry_out(&restore);
		remove_all(restore.staging);
	} else {
		status = db_ctl_fail_file(restore.ctl, restore.staging);
	}
	json_decref(restore.texts);
	json_decref(restore.ports);
	json_decref(restore.others);
	return status;
}
