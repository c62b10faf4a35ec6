/* SPDX-License-Identifier: Apache-2.0 */
#include "web/config.h"

#define AT(member) .offset = offsetof(struct db_web_config, member)

/* clang-format off */
const struct db_setting db_web_keys[] = {
	{ DB_TEXT_SETTING("service", "socket", "/run/drivebridge/control", 1, 107,
	                  "The control socket of drivebridged"),
	  AT(socket) },

	{ DB_TEXT_SETTING("server", "listen", "127.0.0.1:8080", 3, 64,
	                  "Address and TCP port to listen on, an address of IPv6 in brackets; port 0 takes any that is "
	                  "free and tells it in the log"),
	  AT(listen) },
	{ DB_TEXT_SETTING("server", "certificate-file", "", 1, 255,
	                  "Certificate of this gateway with those that it was signed by (PEM); without one there is no TLS"),
	  AT(certificate_file) },
	{ DB_TEXT_SETTING("server", "key-file", "", 1, 255,
	                  "The private key for it (PEM, without a passphrase), which not everybody may read"),
	  AT(key_file) },
	{ DB_LIST_SETTING("server", "hosts", "none", "none",
	                  "Names by which browsers may call this gateway, beside its addresses and localhost"),
	  AT(hosts) },
	{ DB_LIST_SETTING("server", "proxies", "none", "none",
	                  "Addresses of proxies in front, whose X-Forwarded-For and X-Forwarded-Proto are believed"),
	  AT(proxies) },
	{ DB_TEXT_SETTING("server", "page", "/usr/share/drivebridge/web", 1, 255,
	                  "Folder with the files of the page"),
	  AT(page) },
	{ DB_NUMBER_SETTING("server", "connections", "256", 8, 1000, "",
	                    "Connections of browsers at the same time"),
	  AT(connections) },
	{ DB_NUMBER_SETTING("server", "connections-per-address", "32", 4, 1000, "",
	                    "Those of one address, of IPv6 by its first 64 bits, unless it is a proxy's"),
	  AT(connections_per_address) },
	{ DB_NUMBER_SETTING("server", "hsts-days", "180", 0, 3650, "d",
	                    "Where there is TLS, a browser asks this host for nothing without it for so long, whatever the port; "
	                    "0: it forgets that"),
	  AT(hsts_days) },

	{ DB_TEXT_SETTING("access", "users-file", DB_USERS_PATH, 1, 255,
	                  "File with the users of the page and of OPC UA, written by --add-user of either program and by the page"),
	  AT(users_file) },
	{ DB_WORD_SETTING("access", "read", "users", "users all",
	                  "Who may look: users that are logged in, or everybody; acting always needs a login"),
	  AT(read) },
	{ DB_WORD_SETTING("access", "readers-may-stop", "yes", "no yes",
	                  "Whether an observer and an administrator may stop drives, and do nothing else to them"),
	  AT(readers_may_stop) },
	{ DB_NUMBER_SETTING("access", "password-min-length", DB_PASSWORD_MIN_USUAL, DB_PASSWORD_MIN_LEAST,
	                    DB_PASSWORD_MIN_MOST, "",
	                    "Characters that a new password has at least; with a shorter one of before users log in, and are told"),
	  AT(password_min_length) },
	{ DB_TEXT_SETTING("access", "pam-folder", "", 1, 255,
	                  "Folder with the file drivebridge, the rules of PAM for users whose password PAM checks; /etc/pam.d when "
	                  "not given"),
	  AT(pam_folder) },
	{ DB_NUMBER_SETTING("access", "session-idle-min", "60", 1, 1440, "min",
	                    "A login ends when nothing was asked for so long; an observer's streams count, those of others do not"),
	  AT(session_idle_min) },
	{ DB_NUMBER_SETTING("access", "session-h", "12", 1, 8760, "h",
	                    "A login ends after so long in any case"),
	  AT(session_h) },

	{ DB_LIST_SETTING("metrics", "allow", "local", "local none all",
	                  "Addresses and networks that may fetch /metrics without a login; local: this machine"),
	  AT(metrics_allow) },
	{ .name = NULL },
};
/* clang-format on */
