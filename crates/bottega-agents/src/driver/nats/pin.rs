//! Pinning of a server's certificate: no authority is needed, and no other server can take its place.

use std::{fmt, str::FromStr, sync::Arc};

use rustls::{
    ClientConfig, DigitallySignedStruct, Error, SignatureScheme,
    client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier},
    crypto::{CryptoProvider, ring, verify_tls12_signature, verify_tls13_signature},
    pki_types::{CertificateDer, ServerName, UnixTime},
};

/// Length of a pin in bytes: as hard to match as a token is to guess.
const BYTES: usize = 16;

/// The digest of a certificate (BLAKE3, truncated to 16 bytes). Its text is 32 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pin([u8; BYTES]);

impl Pin {
    /// Makes the pin of a certificate in DER.
    pub fn of(certificate: &[u8]) -> Self {
        let hash = blake3::hash(certificate);
        let mut pin = [0; BYTES];
        pin.copy_from_slice(&hash.as_bytes()[..BYTES]);
        Self(pin)
    }

    /// Returns the TLS configuration of a client that accepts only a server with this certificate, and has none itself.
    pub fn client_config(self) -> ClientConfig {
        let provider = Arc::new(ring::default_provider());
        let verifier = Arc::new(OnlyThis { pin: self, provider: Arc::clone(&provider) });
        ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .expect("the provider knows the versions of TLS that it is made for")
            .dangerous()
            .with_custom_certificate_verifier(verifier)
            .with_no_client_auth()
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl FromStr for Pin {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        if text.len() != 2 * BYTES || !text.is_ascii() {
            return Err(());
        }
        let mut pin = [0; BYTES];
        for (byte, at) in pin.iter_mut().zip((0..text.len()).step_by(2)) {
            *byte = u8::from_str_radix(&text[at..at + 2], 16).map_err(|_| ())?;
        }
        Ok(Self(pin))
    }
}

#[derive(Debug)]
struct OnlyThis {
    pin: Pin,
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for OnlyThis {
    fn verify_server_cert(
        &self,
        certificate: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _server_name: &ServerName<'_>,
        _ocsp_response: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        if Pin::of(certificate) == self.pin {
            Ok(ServerCertVerified::assertion())
        } else {
            Err(Error::General("the server's certificate is not that of the farm".to_owned()))
        }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls12_signature(message, certificate, signed, &self.provider.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls13_signature(message, certificate, signed, &self.provider.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider.signature_verification_algorithms.supported_schemes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pin_is_read_as_it_is_written() {
        let pin = Pin::of(b"certificate");
        assert_eq!(pin.to_string().parse(), Ok(pin));
        assert_ne!(Pin::of(b"another"), pin);
        for wrong in ["", "12", "zz", "éééééééééééééééé", &"0".repeat(33)] {
            assert!(wrong.parse::<Pin>().is_err(), "{wrong}");
        }
    }
}
