/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/config.h"
#include "users/users.h"

#define AT(member) .offset = offsetof(struct db_opcua_config, member)

/* clang-format off */
const struct db_setting db_opcua_keys[] = {
	{ DB_TEXT_SETTING("service", "socket", "/run/drivebridge/control", 1, 107,
	                  "The control socket of drivebridged"),
	  AT(socket) },

	{ DB_TEXT_SETTING("server", "address", "", 1, 255,
	                  "Address of this machine to listen on; all of them when not given"),
	  AT(address) },
	{ DB_NUMBER_SETTING("server", "port", "4840", 0, 65535, "",
	                    "TCP port; 0 takes a free one, which the log names"),
	  AT(port) },
	{ DB_TEXT_SETTING("server", "gateway", "", 1, 64,
	                  "Name of this gateway in the application's name, URI and certificate; the machine's host name when "
	                  "not given"),
	  AT(gateway) },
	{ DB_NUMBER_SETTING("server", "interval-ms", "50", 10, 10000, "ms",
	                    "How often values that somebody watches are asked of the service; what is read otherwise is not "
	                    "older than this either"),
	  AT(interval_ms) },
	{ DB_LIST_SETTING("server", "show", "all", "all",
	                  "What is shown of a drive beside its process values and commands, each in a folder: CommandBlock, "
	                  "Parameters, Service, Bits, History"),
	  AT(show) },
	{ DB_LIST_SETTING("server", "reverse-connect", "none", "none",
	                  "Clients that wait for this server to connect to them, behind a firewall that lets nobody in: their addresses, "
	                  "as numbers, and ports, \"opc.tcp://10.0.0.7:4844\". One that does not answer is tried again every 2 s"),
	  AT(reverse_connect) },

	{ DB_WORD_SETTING("security", "none", "off", "off read",
	                  "Whether there are connections without encryption and signature; read: for who only reads. Passwords "
	                  "are encrypted on them as well"),
	  AT(none) },
	{ DB_WORD_SETTING("security", "anonymous", "off", "off read",
	                  "Whether clients without a user may read"),
	  AT(anonymous) },
	{ DB_TEXT_SETTING("security", "pki", "/var/lib/drivebridge-opcua/pki", 1, 200,
	                  "Folder of the certificates: own (made at the first start), trusted, issuers and rejected"),
	  AT(pki) },
	{ DB_TEXT_SETTING("security", "users", DB_USERS_PATH, 1, 255,
	                  "File with the users of the page and of OPC UA, their roles and their hashed passwords"),
	  AT(users) },
	{ DB_WORD_SETTING("security", "readers-may-stop", "yes", "no yes",
	                  "Whether an observer and an administrator, whose connection is signed, may stop drives, and do nothing else to "
	                  "them"),
	  AT(readers_may_stop) },
	{ DB_NUMBER_SETTING("security", "password-min-length", DB_PASSWORD_MIN_USUAL, DB_PASSWORD_MIN_LEAST,
	                    DB_PASSWORD_MIN_MOST, "",
	                    "Characters that a new password has at least; with a shorter one of before users log in, and the log says so"),
	  AT(password_min_length) },
	{ DB_TEXT_SETTING("security", "pam-folder", "", 1, 255,
	                  "Folder with the file drivebridge, the rules of PAM for users whose password PAM checks; /etc/pam.d when "
	                  "not given"),
	  AT(pam_folder) },

	{ DB_NUMBER_SETTING("commands", "confirm-ms", "250", 1, 1000, "ms",
	                    "How long a method or a write waits for the drive's confirmation; then a method ends with "
	                    "BadRequestNotComplete, a write with GoodCompletesAsynchronously, and the result variables "
	                    "tell the end"),
	  AT(confirm_ms) },
	{ DB_NUMBER_SETTING("commands", "silence-ms", "3000", 100, 60000, "ms",
	                    "Longest silence of a client whose drives' watchdogs are fed; then they run down"),
	  AT(silence_ms) },

	{ DB_NUMBER_SETTING("limits", "sessions", "30", 1, 100, "",
	                    "Sessions at the same time; twice as many connections"),
	  AT(sessions) },
	{ DB_NUMBER_SETTING("limits", "subscriptions", "10", 1, 100, "",
	                    "Subscriptions of a session"),
	  AT(subscriptions) },
	{ DB_NUMBER_SETTING("limits", "monitored-items", "20000", 100, 200000, "",
	                    "Monitored items of all sessions together"),
	  AT(items) },
	{ .name = NULL },
};
/* clang-format on */
