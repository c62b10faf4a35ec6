/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/params_source.h"
#include "ctl/plant.h"
#include "ctl/say.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILE_ERROR "io.drivebridge.Client.File"

struct backup {
	struct db_ctl *ctl;
	const char *file;
	char folder[64]; /* where the archive is assembled */
	json_t *missing; /* names of drives whose parameters are not in it */
};

static enum db_ctl_status write_text(const struct backup *backup, const char *name,
                                     const char *text)
{
	char path[PATH_MAX];
	FILE *out;
	bool failed;

	snprintf(path, sizeof(path), "%s/%s", backup->folder, name);
	out = fopen(path, "we");
	failed = !out || fputs(text, out) == EOF;
	if (out)
		failed = fclose(out) != 0 || failed;
	return failed ? db_ctl_fail_file(backup->ctl, path) : DB_CTL_OK;
}

/* If a drive is offline, only its parameters are missing from the backup. */
static enum db_ctl_status add_drive(struct backup *backup, const json_t *families, const char *name)
{
	struct db_params params = { .values = NULL };
	enum db_ctl_status status = db_ctl_params_read_drive(backup->ctl, families, name, true,
	                                                     &params);
	char path[512];
	char *text = NULL;

	if (status == DB_CTL_OK)
		text = db_params_write(&params);
	snprintf(path, sizeof(path), "parameters/%s.params", name);
	if (text)
		status = write_text(backup, path, text);
	else if (status != DB_CTL_UNREACHABLE)
		status = DB_CTL_OK;
	if (!text)
		(void)json_array_append_new(backup->missing, json_string(name));
	free(text);
	db_params_clear(&params);
	return status;
}

/* All but the parameters: as symbolic links, which tar follows. */
static enum db_ctl_status add_folders(const struct backup *backup)
{
	char folder[PATH_MAX];
	char absolute[PATH_MAX];
	char path[PATH_MAX];
	char head[PATH_MAX];
	const char *main_file = db_words_text(backup->ctl->description, "configuration");
	const char *slash = strrchr(main_file, '/');
	enum db_ctl_status status;

	snprintf(folder, sizeof(folder), "%.*s", slash ? (int)(slash - main_file) : 1,
	         slash ? main_file : ".");
	snprintf(head, sizeof(head), DB_CTL_BACKUP_HEAD "\n%s\n%s\n", slash ? slash + 1 : main_file,
	         db_words_text(backup->ctl->description, "version"));
	status = write_text(backup, "gateway", head);
	snprintf(path, sizeof(path), "%s/configuration", backup->folder);
	if (status == DB_CTL_OK && (!realpath(folder, absolute) || symlink(absolute, path) != 0))
		status = db_ctl_fail_file(backup->ctl, folder);
	snprintf(path, sizeof(path), "%s/opcua", backup->folder);
	if (status == DB_CTL_OK && access(DB_CTL_OPCUA_FOLDER, F_OK) == 0 &&
	    symlink(DB_CTL_OPCUA_FOLDER, path) != 0)
		status = db_ctl_fail_file(backup->ctl, path);
	return status;
}

/* The archive has passwords, hashed and plain: nobody else may read it. It is renamed to its final
 * name when it is complete. */
static enum db_ctl_status pack(const struct backup *backup)
{
	char part[PATH_MAX];
	char folder[sizeof(backup->folder)];
	char tar[] = "tar";
	char create[] = "--create";
	char gzip[] = "--gzip";
	char follow[] = "--dereference";
	/* Otherwise tar takes a colon in the file's name for a remote host. */
	char local[] = "--force-local";
	char into[] = "--file";
	char from[] = "--directory";
	char all[] = ".";
	char *words[] = { tar, create, gzip, follow, local, into, part, from, folder, all, NULL };
	int written;

	written = snprintf(part, sizeof(part), "%s.part", backup->file);
	snprintf(folder, sizeof(folder), "%s", backup->folder);
	if (written < 0 || (size_t)written >= sizeof(part)) {
		errno = ENAMETOOLONG;
		return db_ctl_fail_file(backup->ctl, backup->file);
	}
	if (!db_ctl_child_run(words, false)) {
		(void)unlink(part);
		return db_ctl_complain(backup->ctl, DB_CTL_NO, FILE_ERROR,
		                       "%s: not everything could be read (as root it can): nothing "
		                       "is written",
		                       backup->file);
	}
	if (rename(part, backup->file) == 0)
		return DB_CTL_OK;
	return db_ctl_fail_file(backup->ctl, backup->file);
}

static enum db_ctl_status put_together(struct backup *backup)
{
	char path[PATH_MAX];
	enum db_ctl_status status;
	json_t *families;
	size_t i;
	const json_t *drive;

	snprintf(path, sizeof(path), "%s/parameters", backup->folder);
	if (mkdir(path, 0700) != 0)
		return db_ctl_fail_file(backup->ctl, path);
	families = db_ctl_read_families(backup->ctl, &status);
	json_array_foreach(json_object_get(backup->ctl->description, "drives"), i, drive)
	{
		if (status == DB_CTL_OK)
			status = add_drive(backup, families, db_words_text(drive, "name"));
	}
	json_decref(families);
	if (status == DB_CTL_OK)
		status = add_folders(backup);
	if (status == DB_CTL_OK)
		status = pack(backup);
	return status;
}

enum db_ctl_status db_ctl_backup(struct db_ctl *ctl, int count, char **arguments)
{
	struct backup backup = { .ctl = ctl,
		                 .file = arguments[0],
		                 .folder = "/tmp/drivebridge-backup-XXXXXX",
		                 .missing = json_array() };
	char rm[] = "rm";
	char all[] = "-rf";
	char *words[] = { rm, all, backup.folder, NULL };
	enum db_ctl_status status;
	size_t drives = json_array_size(json_object_get(ctl->description, "drives"));
	json_t *object;
	size_t i;
	const json_t *name;

	(void)count;
	(void)umask(077);
	if (!mkdtemp(backup.folder)) {
		json_decref(backup.missing);
		return db_ctl_fail_file(backup.ctl, backup.folder);
	}
	status = put_together(&backup);
	(void)db_ctl_child_run(words, true);
	if (status == DB_CTL_OK && ctl->json) {
		object = json_pack("{s:s, s:O}", "file", backup.file, "missing", backup.missing);
		db_ctl_print_json(object);
		json_decref(object);
	} else if (status == DB_CTL_OK) {
		db_ctl_say_line(stdout, "%s: the configuration, and the parameters of %zu drives",
		                backup.file, drives - json_array_size(backup.missing));
		json_array_foreach(backup.missing, i, name)
		{
			db_ctl_say_line(stdout, "without the parameters of %s",
			                json_string_value(name));
		}
	}
	if (status == DB_CTL_OK && json_array_size(backup.missing) > 0)
		status = DB_CTL_NO;
	json_decref(backup.missing);
	return status;
}
