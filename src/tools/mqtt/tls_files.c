/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/tls_files.h"
#include "client/clock.h"
#include "client/log.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* False with an error in the log: then the copy is as before. */
static bool copy_file(struct db_mqtt_tls_copy *copy, const struct db_certificate_file *file)
{
	int fd = memfd_create("drivebridge-tls", MFD_CLOEXEC);

	if (fd < 0 || write(fd, file->bytes, file->size) != (ssize_t)file->size) {
		db_client_log(DB_CLIENT_ERROR, "no memory for a certificate: %s", strerror(errno));
		if (fd >= 0)
			(void)close(fd);
		return false;
	}
	if (copy->fd >= 0)
		(void)close(copy->fd);
	copy->fd = fd;
	snprintf(copy->path, sizeof(copy->path), "/proc/self/fd/%d", fd);
	return true;
}

static bool load_authorities(const struct db_mqtt_config *config, struct db_certificate_file *file,
                             char why[DB_CERTIFICATE_WHY])
{
	struct db_certificate_facts facts;

	return db_certificate_file_read(file, config->ca_file, why) &&
	       db_certificate_check_list(file, db_client_wall_us() / 1000000, &facts, why) !=
	               DB_CERTIFICATE_WRONG;
}

static bool load(struct db_mqtt_tls_files *files)
{
	const struct db_mqtt_config *config = files->config;
	char why[DB_CERTIFICATE_WHY] = "";
	enum db_certificate_state state;

	if (!load_authorities(config, &files->authorities, why)) {
		db_client_log(DB_CLIENT_ERROR, "%s: %s", config->ca_file, why);
		return false;
	}
	if (!copy_file(&files->copies[DB_MQTT_TLS_AUTHORITIES], &files->authorities))
		return false;
	if (!config->certificate_file[0])
		return true;
	state = db_certificate_pair_load(&files->pair, config->certificate_file, config->key_file,
	                                 db_client_wall_us() / 1000000, why);
	if (state != DB_CERTIFICATE_GOOD)
		db_client_log(DB_CLIENT_ERROR, "%s", why);
	return state != DB_CERTIFICATE_WRONG &&
	       copy_file(&files->copies[DB_MQTT_TLS_CERTIFICATE], &files->pair.certificate) &&
	       copy_file(&files->copies[DB_MQTT_TLS_KEY], &files->pair.key);
}

struct db_mqtt_tls_files *db_mqtt_tls_files_new(const struct db_mqtt_config *config)
{
	struct db_mqtt_tls_files *files = calloc(1, sizeof(*files));

	if (!files)
		return NULL;
	files->config = config;
	for (size_t i = 0; i < DB_MQTT_TLS_FILES; i++)
		files->copies[i].fd = -1;
	if (load(files))
		return files;
	db_mqtt_tls_files_free(files);
	return NULL;
}

void db_mqtt_tls_files_free(struct db_mqtt_tls_files *files)
{
	if (!files)
		return;
	for (size_t i = 0; i < DB_MQTT_TLS_FILES; i++) {
		if (files->copies[i].fd >= 0)
			(void)close(files->copies[i].fd);
	}
	db_certificate_file_clear(&files->authorities);
	db_certificate_pair_clear(&files->pair);
	free(files);
}

const char *db_mqtt_tls_files_path(const struct db_mqtt_tls_files *files,
                                   enum db_mqtt_tls_file file)
{
	const struct db_mqtt_tls_copy *copy = &files->copies[file];

	return copy->fd >= 0 ? copy->path : NULL;
}

void db_mqtt_tls_files_renew(struct db_mqtt_tls_files *files)
{
	const struct db_mqtt_config *config = files->config;
	struct db_certificate_file authorities;
	char why[DB_CERTIFICATE_WHY] = "";

	if (!load_authorities(config, &authorities, why)) {
		db_client_log(DB_CLIENT_ERROR, "%s: %s; the authorities from before stay in use",
		              config->ca_file, why);
	} else if (!db_certificate_file_equal(&authorities, &files->authorities) &&
	           copy_file(&files->copies[DB_MQTT_TLS_AUTHORITIES], &authorities)) {
		struct db_certificate_file before = files->authorities;

		files->authorities = authorities;
		authorities = before;
		db_client_log(DB_CLIENT_NOTICE,
		              "%s: the authorities were read; the next connection has them",
		              config->ca_file);
	}
	db_certificate_file_clear(&authorities);
	if (config->certificate_file[0] &&
	    db_certificate_pair_renew(&files->pair, config->certificate_file, config->key_file,
	                              db_client_wall_us() / 1000000, "the next connection") &&
	    copy_file(&files->copies[DB_MQTT_TLS_CERTIFICATE], &files->pair.certificate))
		(void)copy_file(&files->copies[DB_MQTT_TLS_KEY], &files->pair.key);
}
