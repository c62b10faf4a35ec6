/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/security.h"
#include "opcua/operands.h"

#include "certificates/own.h"
#include "client/clock.h"
#include "client/log.h"
#include "drivebridge/hash.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <open62541/plugin/pki_default.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

/* Of the own certificate: clients have to trust the next one anew. */
#define DAYS (5 * 365)

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

	snprintf(path.text, sizeof(path.text), "%s%s%s%s%s", config->pki, folder[0] ? "/" : "",
	         folder, name[0] ? "/" : "", name);
	return path;
}

static int64_t wall_s(void)
{
	return db_client_wall_us() / 1000000;
}

/* --- files ------------------------------------------------------------------------------------ */

/* Atomically; synchronized to the disk only where that is worth its time. */
static bool write_file(const char *path, const void *bytes, size_t size, mode_t mode, bool for_good)
{
	char other[340];
	int fd;
	bool good;

	snprintf(other, sizeof(other), "%s.new", path);
	fd = open(other, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, mode);
	good = fd >= 0 && write(fd, bytes, size) == (ssize_t)size && (!for_good || fsync(fd) == 0);
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

static bool make_own(const struct db_opcua_config *config, const char *certificate_path,
                     const char *key_path)
{
	struct db_certificate_file certificate;
	struct db_certificate_file key;
	char name[96];
	char uri[128];
	char why[DB_CERTIFICATE_WHY];
	struct db_certificate_wish wish = { .name = name,
		                            .organization = "drivebridge",
		                            .host = config->gateway,
		                            .uri = uri,
		                            .days = DAYS };
	bool made;
	bool good;

	snprintf(name, sizeof(name), "drivebridge on %s", config->gateway);
	snprintf(uri, sizeof(uri), "urn:%s:drivebridge", config->gateway);
	made = db_certificate_make_own(&wish, wall_s(), &certificate, &key, why);
	if (!made)
		db_client_log(DB_CLIENT_ERROR, "no certificate can be made: %s", why);
	good = made && write_file(key_path, key.bytes, key.size, 0600, true) &&
	       write_file(certificate_path, certificate.bytes, certificate.size, 0644, true);
	if (good)
		db_client_log(DB_CLIENT_NOTICE, "a certificate was made: %s", certificate_path);
	db_certificate_file_clear(&certificate);
	db_certificate_file_clear(&key);
	return good;
}

UA_StatusCode db_opcua_security_load(const struct db_opcua_config *config,
                                     struct db_certificate_pair *own)
{
	struct path certificate = path_of(config, "own", "cert.der");
	struct path key = path_of(config, "own", "key.der");
	bool has_certificate = access(certificate.text, F_OK) == 0;
	char why[DB_CERTIFICATE_WHY];
	enum db_certificate_state state;

	*own = (struct db_certificate_pair){ .facts = { .subject = "" } };
	if (!make_folders(config))
		return UA_STATUSCODE_BADNOTWRITABLE;
	/* One file without the other is an accident, and clients trust the former certificate: make
	 * no new one. */
	if (has_certificate != (access(key.text, F_OK) == 0)) {
		db_client_log(DB_CLIENT_ERROR,
		              "%s and %s must both be readable; without both new ones are made",
		              certificate.text, key.text);
		return UA_STATUSCODE_BADNOTREADABLE;
	}
	if (!has_certificate && !make_own(config, certificate.text, key.text))
		return UA_STATUSCODE_BADNOTWRITABLE;
	state = db_certificate_pair_load(own, certificate.text, key.text, wall_s(), why);
	if (state != DB_CERTIFICATE_GOOD)
		db_client_log(state == DB_CERTIFICATE_WRONG ? DB_CLIENT_ERROR : DB_CLIENT_WARNING,
		              "%s", why);
	return state == DB_CERTIFICATE_WRONG ? UA_STATUSCODE_BADNOTREADABLE : UA_STATUSCODE_GOOD;
}

bool db_opcua_security_renew(const struct db_opcua_config *config, struct db_certificate_pair *own)
{
	struct path certificate = path_of(config, "own", "cert.der");
	struct path key = path_of(config, "own", "key.der");

	return db_certificate_pair_renew(own, certificate.text, key.text, wall_s(),
	                                 "each new connection");
}

void db_opcua_security_look(const struct db_opcua_config *config, struct db_certificate_pair *own,
                            int64_t us)
{
	struct path certificate = path_of(config, "own", "cert.der");

	db_certificate_pair_look(own, certificate.text, us / 1000000);
}

bool db_opcua_security_check(const struct db_opcua_config *config)
{
	struct path certificate = path_of(config, "own", "cert.der");
	struct path key = path_of(config, "own", "key.der");

	return (access(certificate.text, F_OK) != 0 && access(key.text, F_OK) != 0) ||
	       db_certificate_pair_check(certificate.text, key.text, wall_s(), stderr);
}

UA_ByteString db_opcua_security_bytes(const struct db_certificate_file *file)
{
	return (UA_ByteString){ .length = file->size, .data = (UA_Byte *)file->bytes };
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
	return db_hash_add(DB_HASH_BEGIN, bytes->data, bytes->length);
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

	snprintf(name, sizeof(name), "%016llx.der", (unsigned long long)number_of(certificate));
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
		(void)write_file(path.text, certificate->data, certificate->length, 0640, false);
	}
	db_client_log_rationed(
		&guard->lines, db_client_now(), DB_CLIENT_WARNING,
		"a client is not trusted (%s): %.*s; to trust it, move %s into %s/trusted",
		UA_StatusCode_name(why), (int)subject.length, (const char *)subject.data, path.text,
		guard->config->pki);
	UA_String_clear(&subject);
}

/* The file with which the library cannot do anything, in words. */
static struct path find_stray(const struct db_opcua_config *config)
{
	static const char *const folders[] = { "trusted", "issuers" };
	char why[DB_CERTIFICATE_WHY];
	struct path found;

	for (size_t i = 0; i < sizeof(folders) / sizeof(folders[0]); i++) {
		struct path folder = path_of(config, folders[i], "");
		DIR *stream = opendir(folder.text);
		struct dirent *entry;
		bool good = true;

		while (good && stream && (entry = readdir(stream))) {
			struct db_certificate_file file;
			struct db_certificate_facts facts;

			found = path_of(config, folders[i], entry->d_name);
			if (entry->d_type != DT_REG)
				continue;
			good = db_certificate_file_read(&file, found.text, why) &&
			       db_certificate_check_list(&file, wall_s(), &facts, why) !=
			               DB_CERTIFICATE_WRONG;
			db_certificate_file_clear(&file);
		}
		if (stream)
			(void)closedir(stream);
		if (!good)
			return found;
	}
	snprintf(found.text, sizeof(found.text), "a file in %s/revoked", config->pki);
	return found;
}

/* Nobody can trust this one: it is not kept for that. */
static void tell_useless(struct guard *guard, const UA_ByteString *certificate, const char *why)
{
	UA_ByteString copy = *certificate;
	UA_String subject = UA_STRING_NULL;

	(void)guard->parser.getSubjectName(&subject, &copy);
	db_client_log_rationed(&guard->lines, db_client_now(), DB_CLIENT_WARNING,
	                       "a client's certificate %s (%.*s)", why, (int)subject.length,
	                       (const char *)subject.data);
	UA_String_clear(&subject);
}

static UA_StatusCode verify(const UA_CertificateVerification *cv, const UA_ByteString *certificate)
{
	struct guard *guard = cv->context;
	UA_StatusCode status = guard->library.verifyCertificate(&guard->library, certificate);

	if (status == UA_STATUSCODE_BADINTERNALERROR) {
		db_time now = db_client_now();

		/* Looking for the file reads all of them: not for a line that is left out. */
		db_client_log_rationed(
			&guard->lines, now, DB_CLIENT_ERROR,
			"%s is none that belongs there; until it is taken out nobody is trusted",
			db_client_log_is_due(&guard->lines, now) ? find_stray(guard->config).text :
								   "a file");
	} else if (status == UA_STATUSCODE_BADCERTIFICATETIMEINVALID)
		tell_useless(
			guard, certificate,
			"is not valid now, or its authority's or a list of revoked ones is not; "
			"renew what has ended, or set the clock that is wrong");
	else if (status == UA_STATUSCODE_BADCERTIFICATEREVOKED)
		tell_useless(guard, certificate, "was revoked by its authority");
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

/* --- messages --------------------------------------------------------------------------------- */

typedef UA_StatusCode check_fn(void *channel, const UA_ByteString *message,
                               const UA_ByteString *signature);

/* The library's own functions, which check a message's signature. They are found by their place: a
 * channel does not lead to its policy. Set before the server begins, and not changed then. */
#define CHECKS_MAX 3
static check_fn *checks[CHECKS_MAX];

static UA_StatusCode check(size_t place, void *channel, const UA_ByteString *message,
                           const UA_ByteString *signature)
{
	UA_StatusCode status = checks[place](channel, message, signature);

	/* A message that opens a channel is not looked at. */
	if (status == UA_STATUSCODE_GOOD)
		db_opcua_operands_mend(message->data, message->length);
	return status;
}

#define CHECK(place)                                                                   \
	static UA_StatusCode check##place(void *channel, const UA_ByteString *message, \
	                                  const UA_ByteString *signature)              \
	{                                                                              \
		return check(place, channel, message, signature);                      \
	}

CHECK(0)
CHECK(1)
CHECK(2)

#undef CHECK

void db_opcua_security_mend(UA_SecurityPolicy *policy)
{
	static check_fn *const mending[CHECKS_MAX] = { check0, check1, check2 };
	check_fn **own = &policy->symmetricModule.cryptoModule.signatureAlgorithm.verify;
	size_t place = 0;

	while (place < CHECKS_MAX && checks[place] && checks[place] != *own)
		place++;
	/* Without it a condition's id is not told. */
	if (place == CHECKS_MAX || !*own)
		return;
	checks[place] = *own;
	*own = mending[place];
}
