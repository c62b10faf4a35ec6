/* SPDX-License-Identifier: Apache-2.0 */
#include "tls/config.h"

#define AT(member) .offset = offsetof(struct db_tls_config, member)

/* clang-format off */
const struct db_setting db_tls_keys[] = {
	{ DB_TEXT_SETTING("service", "socket", "/run/drivebridge/modbus", 1, 107,
	                  "The secure socket of drivebridged: secure-socket in the section modbus of its configuration"),
	  AT(socket) },

	{ DB_TEXT_SETTING("server", "address", "", 1, 255,
	                  "Address of this machine to listen on, as a number; all of them when not given"),
	  AT(address) },
	{ DB_NUMBER_SETTING("server", "port", "802", 0, 65535, "",
	                    "TCP port; 0 takes a free one, which the log names"),
	  AT(port) },
	{ DB_WORD_SETTING("server", "min-version", "1.2", "1.2 1.3",
	                  "Oldest version of TLS that is spoken"),
	  AT(min_version) },
	{ DB_NUMBER_SETTING("server", "clients", "64", 1, 512, "",
	                    "Clients at the same time; drivebridged has a limit for all of its own, max-clients"),
	  AT(clients) },
	{ DB_NUMBER_SETTING("server", "clients-per-address", "16", 1, 512, "",
	                    "How many of them from one address; of IPv6 the first 64 bits count"),
	  AT(clients_per_address) },

	{ DB_TEXT_SETTING("certificates", "certificate-file", "/etc/drivebridge/tls/server.pem", 1, 255,
	                  "Certificate of this gateway, and behind it those that it was signed by (PEM)"),
	  AT(certificate_file) },
	{ DB_TEXT_SETTING("certificates", "key-file", "/etc/drivebridge/tls/server-key.pem", 1, 255,
	                  "Its private key (PEM, without a passphrase), which not everybody may read"),
	  AT(key_file) },
	{ DB_TEXT_SETTING("certificates", "ca-file", "/etc/drivebridge/tls/authority.pem", 1, 255,
	                  "Certificates of the authorities by which clients' certificates must be signed (PEM)"),
	  AT(ca_file) },
	{ DB_TEXT_SETTING("certificates", "crl-file", "/etc/drivebridge/tls/revoked.pem", 0, 255,
	                  "Lists of revoked certificates by these authorities (PEM); \"\": none, and no certificate can be taken back"),
	  AT(crl_file) },
	{ .name = NULL },
};
/* clang-format on */
