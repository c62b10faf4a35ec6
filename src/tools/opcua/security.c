/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/security.h"
#include "opcua/values.h"

#include "client/clock.h"
#include "client/log.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <open62541/plugin/create_certificate.h>
#include <open62541/plugin/pki_default.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define KEY_BITS 2048
#define DAYS (20 * 365)
#define FILE_MAX 65536

/* Most kept certificates of clients that are not trusted, and the shortest interval between two: so
 * a client that sends many does not wear out the disk. */
#define REJECTED_MAX 32
#define REJECTED_EVERY 1

struct path {
	char text[320];
};

static struct path path_of(const struct db_opcua_config *config, const char *folder,
                           const char *name)
{
	struct path path;

	(void)snprintf(path.text, sizeof(path.text), "%s%s%s%s%s", config->pki,
	               folder[0] ? "/" : "", folder, name[0] ? "/" : "", name);
	return path;
}

/* --- files ------------------------------------------------------------------------------------ */

static UA_StatusCode read_file(const char *path, UA_ByteString *bytes)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC);
	struct stat status;
	UA_StatusCode result = UA_STATUSCODE_BADNOTFOUND;

	if (fd >= 0 && fstat(fd, &status) == 0 && status.st_size > 0 &&
	    status.st_size <= FILE_MAX) {
		result = UA_ByteString_allocBuffer(bytes, (size_t)status.st_size);
		if (result == UA_STATUSCODE_GOOD &&
		    read(fd, bytes->data, bytes->length) != (ssize_t)bytes->length) {
			UA_ByteString_clear(bytes);
			result = UA_STATUSCODE_BADNOTREADABLE;
		}
	}
	if (fd >= 0)
		(void)close(fd);
	return result;
}

/* Atomically; synchronized to the disk only where that is worth its time. */
static bool write_file(const char *path, const UA_ByteString *bytes, mode_t mode, bool for_good)
{
	char other[340];
	int fd;
	bool good;

	(void)snprintf(other, sizeof(other), "%s.new", path);
	fd = open(other, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, mode);
	good = fd >= 0 && write(fd, bytes->data, bytes->length) == (ssize_t)bytes->length &&
	       (!for_good || fsync(fd) == 0);
	if (fd >= 0)
		good = close(fd) == 0 && good;
	good = good && rename(other, path) == 0;
	if (!good)
		db_client_log(DB_CLIENT_ERROR, "%s cannot be written: %s", path, strerror(errno));
	return good;
}

static bool make_folders(const struct db_opcua_config *config)
{
	static const char *const folders[] = { "",        "own",     "trusted",
		                               "issuers", "revoked", "rejected" };

	for (size_t i = 0; i < sizeof(folders) / sizeof(folders[0]); i++) {
		struct path path = path_of(config, folders[i], "");

		if (mkdir(path.text, 0750) != 0 && errno != EEXIST) {
			db_client_log(DB_CLIENT_ERROR, "%s cannot be made: %s", path.text,
			              strerror(errno));
			return false;
		}
	}
	return true;
}

/* --- the server's own ------------------------------------------------------------------------- */

static UA_StatusCode make_certificate(const struct db_opcua_config *config, const UA_Logger *logger,
                                      UA_ByteString *certificate, UA_ByteString *key)
{
	char name[96];
	char host[96];
	char uri[128];
	UA_UInt16 bits = KEY_BITS;
	UA_UInt16 days = DAYS;
	UA_KeyValuePair pairs[2] = {
		{ .key = { .name = UA_STRING_STATIC("key-size-bits") } },
		{ .key = { .name = UA_STRING_STATIC("expires-in-days") } },
	};
	UA_KeyValueMap options = { .map = pairs, .mapSize = 2 };
	UA_String subject[2];
	UA_String others[2];

	UA_Variant_setScalar(&pairs[0].value, &bits, &UA_TYPES[UA_TYPES_UINT16]);
	UA_Variant_setScalar(&pairs[1].value, &days, &UA_TYPES[UA_TYPES_UINT16]);
	(void)snprintf(name, sizeof(name), "CN=drivebridge on %s", config->gateway);
	(void)snprintf(host, sizeof(host), "DNS:%s", config->gateway);
	(void)snprintf(uri, sizeof(uri), "URI:urn:%s:drivebridge", config->gateway);
	subject[0] = db_opcua_string(name);
	subject[1] = db_opcua_string("O=drivebridge");
	others[0] = db_opcua_string(host);
	others[1] = db_opcua_string(uri);
	return UA_CreateCertificate(logger, subject, 2, others, 2, UA_CERTIFICATEFORMAT_DER,
	                            &options, key, certificate);
}

UA_StatusCode db_opcua_security_load(const struct db_opcua_config *config, const UA_Logger *logger,
                                     UA_ByteString *certificate, UA_ByteString *key)
{
	struct path certificate_path = path_of(config, "own", "cert.der");
	struct path key_path = path_of(config, "own", "key.der");
	UA_StatusCode status;

	UA_ByteString_init(certificate);
	UA_ByteString_init(key);
	if (!make_folders(config))
		return UA_STATUSCODE_BADNOTWRITABLE;
	if (read_file(certificate_path.text, certificate) == UA_STATUSCODE_GOOD &&
	    read_file(key_path.text, key) == UA_STATUSCODE_GOOD)
		return UA_STATUSCODE_GOOD;
	UA_ByteString_clear(certificate);
	/* One file without the other is an accident, and clients trust the former certificate: make
	 * no new one. */
	if (access(certificate_path.text, F_OK) == 0 || access(key_path.text, F_OK) == 0) {
		db_client_log(DB_CLIENT_ERROR,
		              "%s and %s must both be readable; without both new ones are made",
		              certificate_path.text, key_path.text);
		return UA_STATUSCODE_BADNOTREADABLE;
	}
	status = make_certificate(config, logger, certificate, key);
	if (status == UA_STATUSCODE_GOOD &&
	    (!write_file(key_path.text, key, 0600, true) ||
	     !write_file(certificate_path.text, certificate, 0644, true)))
		status = UA_STATUSCODE_BADNOTWRITABLE;
	if (status == UA_STATUSCODE_GOOD)
		db_client_log(DB_CLIENT_NOTICE, "a certificate was made: %s",
		              certificate_path.text);
	return status;
}

/* --- trust ------------------------------------------------------------------------------------ */

struct guard {
	const struct db_opcua_config *config;
	time_t kept; /* when a certificate was last kept */
	struct db_client_log_ration lines;
	/* the library's verification, which reads the folders */
	UA_CertificateVerification library;
	UA_CertificateVerification
		parser; /* the same without folders: the other one cannot tell subjects */
};

/* Part of a file's name: the same for the same certificate. */
static uint64_t number_of(const UA_ByteString *bytes)
{
	uint64_t number = UINT64_C(0xcbf29ce484222325);

	for (size_t i = 0; i < bytes->length; i++)
		number = (number ^ bytes->data[i]) * UINT64_C(0x100000001b3);
	return number;
}

/* Removes the oldest one when there are too many. */
static void make_room(const struct db_opcua_config *config)
{
	struct path folder = path_of(config, "rejected", "");
	struct path oldest = { .text = "" };
	DIR *stream = opendir(folder.text);
	time_t time = 0;
	size_t count = 0;
	struct dirent *entry;

	while (stream && (entry = readdir(stream))) {
		struct path path = path_of(config, "rejected", entry->d_name);
		struct stat status;

		if (stat(path.text, &status) != 0 || !S_ISREG(status.st_mode))
			continue;
		count++;
		if (oldest.text[0] == '\0' || status.st_mtime < time) {
			oldest = path;
			time = status.st_mtime;
		}
	}
	if (stream)
		(void)closedir(stream);
	if (count >= REJECTED_MAX)
		(void)unlink(oldest.text);
}

static void keep_rejected(struct guard *guard, const UA_ByteString *certificate, UA_StatusCode why)
{
	UA_ByteString copy = *certificate;
	UA_String subject = UA_STRING_NULL;
	struct path path;
	char name[32];

	(void)snprintf(name, sizeof(name), "%016llx.der",
	               (unsigned long long)number_of(certificate));
	path = path_of(guard->config, "rejected", name);
	(void)guard->parser.getSubjectName(&subject, &copy);
	if (access(path.text, F_OK) != 0) {
		time_t now = time(NULL);

		if (now >= guard->kept && now < guard->kept + REJECTED_EVERY) {
			UA_String_clear(&subject);
			return;
		}
		guard->kept = now;
		make_room(guard->config);
		(void)write_file(path.text, certificate, 0640, false);
	}
	db_client_log_rationed(
		&guard->lines, db_client_now(), DB_CLIENT_WARNING,
		"a client is not trusted (%s): %.*s; to trust it, move %s into %s/trusted",
		UA_StatusCode_name(why), (int)subject.length, (const char *)subject.data, path.text,
		guard->config->pki);
	UA_String_clear(&subject);
}

static UA_StatusCode verify(const UA_CertificateVerification *cv, const UA_ByteString *certificate)
{
	struct guard *guard = cv->context;
	UA_StatusCode status = guard->library.verifyCertificate(&guard->library, certificate);

	if (status == UA_STATUSCODE_BADINTERNALERROR)
		db_client_log_rationed(
			&guard->lines, db_client_now(), DB_CLIENT_ERROR,
			"a file in %s, in trusted, issuers or revoked, is none that belongs "
			"there; until it is taken out nobody is trusted",
			guard->config->pki);
	else if (status != UA_STATUSCODE_GOOD)
		keep_rejected(guard, certificate, status);
	return status;
}

static UA_StatusCode verify_uri(const UA_CertificateVerification *cv,
                                const UA_ByteString *certificate, const UA_String *uri)
{
	const struct guard *guard = cv->context;

	return guard->library.verifyApplicationURI(&guard->library, certificate, uri);
}

static void clear_guard(UA_CertificateVerification *cv)
{
	struct guard *guard = cv->context;

	if (guard) {
		guard->library.clear(&guard->library);
		guard->parser.clear(&guard->parser);
	}
	free(guard);
	cv->context = NULL;
}

UA_StatusCode db_opcua_security_guard(const struct db_opcua_config *config,
                                      UA_CertificateVerification *guard)
{
	struct guard *own = calloc(1, sizeof(*own));
	struct path trusted = path_of(config, "trusted", "");
	struct path issuers = path_of(config, "issuers", "");
	struct path revoked = path_of(config, "revoked", "");
	UA_StatusCode status;

	if (!own)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	own->config = config;
	own->library.logging = guard->logging;
	own->parser.logging = guard->logging;
	status = UA_CertificateVerification_Trustlist(&own->parser, NULL, 0, NULL, 0, NULL, 0);
	if (status != UA_STATUSCODE_GOOD) {
		free(own);
		return status;
	}
	status = UA_CertificateVerification_CertFolders(&own->library, trusted.text, issuers.text,
	                                                revoked.text);
	/* An invalid file in the folders is reported when a client connects. */
	if (!own->library.verifyCertificate) {
		own->parser.clear(&own->parser);
		free(own);
		return status;
	}
	if (guard->clear)
		guard->clear(guard);
	guard->context = own;
	guard->verifyCertificate = verify;
	guard->verifyApplicationURI = verify_uri;
	guard->getExpirationDate = own->parser.getExpirationDate;
	guard->getSubjectName = own->parser.getSubjectName;
	guard->clear = clear_guard;
	return UA_STATUSCODE_GOOD;
}
